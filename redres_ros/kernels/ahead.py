"""Compiles the formulas of a run before it begins, in two processes, unless they are cached.

As a program, this is the second process.
"""

import subprocess
from importlib import import_module

from redres_ros.files.processes import module_command, module_environment
from redres_ros.kernels.compile_log import time_compiling

_FIRST = 'redres_ros.kernels.tick'  # the smallest; whether it was there says whether others are
_LARGEST = 'redres_ros.kernels.active_set'  # takes as long as all others together
_OTHERS = (
    'redres_ros.kernels.boxes',
    'redres_ros.kernels.closed_form',
    'redres_ros.kernels.rotation_error',
    'redres_ros.kernels.straight_line',
)


def compile_ahead() -> None:
    """Compile what is not cached. Without a writable cache the second process does not help: the
    largest formula is compiled when it is loaded.
    """
    import_module(_FIRST)
    if not time_compiling():
        return
    command = module_command('redres_ros.kernels.ahead')
    with subprocess.Popen(command, env=module_environment(), stderr=subprocess.DEVNULL):
        for name in _OTHERS:
            import_module(name)


if __name__ == '__main__':
    import_module(_LARGEST)
