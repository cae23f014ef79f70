"""The fake robot controller, without ROS: from session to simulated arm."""
