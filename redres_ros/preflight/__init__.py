"""`redres check`: what is missing before a connected arm may move."""
