"""What runs on the robot: each node converts, makes one call to the core, and converts back."""

import os

# Threads do not speed up matrices of seven joints: they would only take memory and cores.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
