"""A running graph from outside: observe its nodes, query them, steer them."""
