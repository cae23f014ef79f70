"""What happens between two ticks, without ROS: cycles, task velocities, the session."""
