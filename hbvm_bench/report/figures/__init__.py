"""What a report draws, and how figures become files."""
