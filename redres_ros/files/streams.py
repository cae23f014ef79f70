"""The standard streams of a process, which may be missing."""

import os
import sys


def open_error_output() -> None:
    """Discard errors if standard error is closed, as after `redres demo 2>&-`.

    Python then has no sys.stderr, which rclpy needs. And the first file that is opened would take
    its number, into which libraries in C write.
    """
    if sys.stderr is None:
        sys.stderr = open(os.devnull, 'w')  # noqa: SIM115, for as long as the process lives
