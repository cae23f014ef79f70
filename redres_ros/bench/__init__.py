"""How fast it is: a tick beside its peers, the loop over DDS beside bare echoes."""
