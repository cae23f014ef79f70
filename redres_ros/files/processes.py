"""Processes: their standard streams, their end with a parent, and modules of ours in new ones."""

import ctypes
import os
import signal
import sys

_PR_SET_PDEATHSIG = 1  # Linux, see prctl(2)


def open_error_output() -> None:
    """Discard errors if standard error is closed, as after `redres demo 2>&-`.

    Python then has no sys.stderr, which rclpy needs. And the first file that is opened would take
    its number, into which libraries in C write.
    """
    if sys.stderr is None:
        sys.stderr = open(os.devnull, 'w')  # noqa: SIM115, for as long as the process lives


def end_with_parent(number: signal.Signals) -> None:
    """Have the kernel send this process a signal when its parent dies."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, number)


def module_command(name: str) -> list[str]:
    """The beginning of a command line that runs a module 'redres_ros.…'."""
    return [sys.executable, '-P', '-m', name]


def module_environment() -> dict[str, str]:
    """The environment in which that module comes from where this process has its own.

    Without it, Python would look in the working directory first: somebody who runs the installed
    package in a clone of it would mix the two.
    """
    path = os.pathsep.join(os.path.abspath(entry) for entry in sys.path)
    return {**os.environ, 'PYTHONPATH': path}
