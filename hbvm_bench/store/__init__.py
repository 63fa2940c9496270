"""What is kept of a run: records and series in a directory, and several runs as one."""
