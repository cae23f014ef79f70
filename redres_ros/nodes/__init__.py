"""The ROS 2 side: the only place that imports rclpy and messages."""

import os

# Matrices of seven joints are no work for several threads: numpy's and scipy's would only take up
# memory and cores.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
