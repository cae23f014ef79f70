"""The loop without ROS, for any task: run, record, compare and plot."""
