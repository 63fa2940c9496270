"""Methods for mechanical systems with constraints, beside HBVM."""
