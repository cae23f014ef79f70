"""A page in the browser that shows a running graph and steers it."""
