"""Formulas compiled by numba, all in one room: a change of any file here compiles them anew."""
