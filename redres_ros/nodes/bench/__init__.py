"""Nodes that measure, and what runs them. The figures are those of experiments/bench."""
