"""A process that keeps one processor from sleeping: `python busy_loop.py PROCESSOR PARENT`.

It runs while nobody else wants the processor, and makes way at once. It imports nothing of this
package, so that it is small and begins quickly, and it ends with the process that started it.
"""

import ctypes
import os
import signal
import sys
from contextlib import suppress
from pathlib import Path

_PR_SET_PDEATHSIG = 1  # Linux, see prctl(2)
_LEAST_SHARE = '19'  # a niceness, see sched(7)


def keep_busy(processor: int, parent: int) -> None:
    """Loop until the parent has ended.

    Args:
        processor: Its number.
        parent: Number of the process that started this one.
    """
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    os.sched_setaffinity(0, [processor])
    os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
    # The kernel may share processors among sessions first, and only then look at priorities.
    with suppress(OSError):
        Path('/proc/self/autogroup').write_text(_LEAST_SHARE)
    while os.getppid() == parent:
        for _ in range(1_000_000):
            pass


if __name__ == '__main__':
    keep_busy(int(sys.argv[1]), int(sys.argv[2]))
