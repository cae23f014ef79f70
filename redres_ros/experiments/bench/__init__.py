"""How long things take, side by side with others' ways of doing them. What needs ROS for it is in nodes/bench."""
