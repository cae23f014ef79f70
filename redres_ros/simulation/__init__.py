"""The loop without ROS, for any task: run it, record it, compare and draw what came of it."""
