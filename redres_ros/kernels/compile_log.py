"""Reports why a start takes so long: formulas are compiled, once after an installation or update.

Nodes are started by others, who see their output only: so it is reported on a terminal and off it.
This file does without numba, which takes a third of a second to load.
"""

import sys
import time

_times: list[float] = []  # [s] when, in this process; the first of them was reported


def log_compiling(folder: str) -> None:
    """Note that a formula was compiled, and say so of the first in a process: more will be.

    Args:
        folder: Where they are kept; empty for nowhere.
    """
    _times.append(time.monotonic())
    if len(_times) > 1:
        return
    how_often = f'once, and kept in {folder}'
    if not folder:
        how_often = 'in every process, as no folder can be written; NUMBA_CACHE_DIR names one'
    print(
        f'compiling the formulas, which takes a quarter of a minute: {how_often}',
        file=sys.stderr,
        flush=True,
    )


def time_compiling() -> float:
    """From when that was said to the last formula [s]; 0 where nothing was compiled."""
    return _times[-1] - _times[0] if _times else 0.0
