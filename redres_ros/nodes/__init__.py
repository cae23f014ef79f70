"""What runs on the robot: each node converts, makes one call to the core, and converts back."""

import os

# Matrices of seven joints are no work for several threads: numpy's and scipy's would only take up
# memory and cores.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
