"""What is computed of the paper: each experiment returns numbers, and knows nothing of the report."""
