"""A run of the nodes from outside: start them, record them, watch them, ask them."""
