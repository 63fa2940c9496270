"""General and stiff systems with known end values."""
