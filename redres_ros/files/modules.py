"""Modules of this package that run in processes of their own."""

import os
import sys


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
