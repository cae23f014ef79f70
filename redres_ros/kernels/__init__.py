"""Formulas compiled by numba; each file holds all that its functions call (compiled.py)."""
