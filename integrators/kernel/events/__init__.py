"""Where functions of time and state vanish, found in compiled code step by step."""
