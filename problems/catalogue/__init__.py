"""The built-in problems; files that start with an underscore have what several of them share."""
