"""The fake KUKA robot controller with its FRI-like interface, without ROS: from session to
simulated arm.
"""
