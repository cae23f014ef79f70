"""Waypoints, planner, and the execution of tasks."""
