"""A run of the three nodes from start to end: processes, recordings, and results."""
