"""Whether this run has the whole night: then tests try more cases."""

import os
from collections.abc import Iterable
from typing import TypeVar

import numpy as np

NIGHTLY = os.environ.get('REDRES_NIGHTLY') == '1'

C = TypeVar('C')


def by_day(number: int, cases: Iterable[C]) -> list[C]:
    """All cases at night; by day so many of them, the same ones every time."""
    every = list(cases)
    if NIGHTLY:
        return every
    chosen = np.random.default_rng(0).choice(len(every), number, replace=False)
    return [every[index] for index in sorted(chosen)]
