"""A running graph from outside: hear what its nodes say, ask them, steer them, record them."""
