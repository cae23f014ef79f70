"""Benchmarks: a tick beside its peers, the loop over DDS beside bare echoes."""
