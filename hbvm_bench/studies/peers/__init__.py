"""What the bench costs the libraries that it measures."""
