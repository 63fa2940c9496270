"""HBVM that chooses everything itself."""
