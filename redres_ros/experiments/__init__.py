"""Closed loops without ROS, and what is drawn and computed from their recordings."""
