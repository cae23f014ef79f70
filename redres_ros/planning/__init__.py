"""What the arm is to do: waypoints, the planner, and tasks as they are executed."""
