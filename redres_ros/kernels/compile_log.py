"""Reports why a start takes so long: formulas are compiled, once after an installation or update.

The line is printed without a terminal, too: nodes are often started by other programs. This file
does not load numba, which takes a third of a second.
"""

import sys
import time

_times: list[float] = []  # [s] when, in this process; the first of them was reported


def log_compiling(folder: str) -> None:
    """Record that a formula was compiled; print a line for the first one of a process.

    Args:
        folder: Where they are cached; empty: nowhere.
    """
    _times.append(time.monotonic())
    if len(_times) > 1:
        return
    how_often = f'once, cached in {folder}'
    if not folder:
        how_often = 'in every process, since no cache is writable; set NUMBA_CACHE_DIR'
    line = f'compiling the formulas, about a quarter of a minute: {how_often}'
    print(line, file=sys.stderr, flush=True)


def time_compiling() -> float:
    """Time from that line to the last formula [s]; 0 if nothing was compiled."""
    return _times[-1] - _times[0] if _times else 0.0
