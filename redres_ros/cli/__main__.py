"""`python -m redres_ros.cli`, the same as `redres`."""

import sys

from redres_ros.cli import main

if __name__ == '__main__':
    sys.exit(main())
