"""A run of the three nodes from start to end: processes, tapes, and what came of it."""
