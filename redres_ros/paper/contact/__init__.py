"""Contact behind a position interface, measured: beside schemes of second order, and by itself."""
