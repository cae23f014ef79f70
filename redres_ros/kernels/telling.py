"""Telling why a start takes so long: formulas are compiled, once after an installation or update.

Nodes are started by others, who see their output only: so it is told whether a person looks on or
not. This file does without numba, which takes a third of a second to load.
"""

import sys
import time

_begun: list[float] = []  # [s] when, in this process


def tell_compiling(folder: str) -> None:
    """Say, once in a process, that formulas are compiled.

    Args:
        folder: Where they are kept; empty for nowhere.
    """
    if _begun:
        return
    _begun.append(time.monotonic())
    how_often = f'once, and kept in {folder}'
    if not folder:
        how_often = 'in every process, as no folder to keep them in can be written'
    print(
        f'compiling the formulas, which takes a quarter of a minute: {how_often}',
        file=sys.stderr,
        flush=True,
    )


def time_compiling() -> float:
    """Since that was said [s]; 0 where nothing is compiled."""
    return time.monotonic() - _begun[0] if _begun else 0.0
