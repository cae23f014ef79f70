"""Between the process that measures and the one that asks: which processes, and what came of it."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from redres_ros.bench.exchange import Exchange


def write_exchanges(exchanges: Mapping[str, Exchange], path: Path) -> None:
    """Write them by name."""
    content = {
        name: {
            'period': exchange.period,
            'latencies': exchange.latencies.tolist(),
            'processors': dict(exchange.processors),
            'skipped': exchange.skipped,
        }
        for name, exchange in exchanges.items()
    }
    path.with_suffix('.part').write_text(json.dumps(content))
    path.with_suffix('.part').rename(path)  # who waits for the file finds it complete


def read_exchanges(path: Path) -> dict[str, Exchange]:
    """Read what was written; Python's json knows infinity."""
    content = json.loads(path.read_text())
    return {
        name: Exchange(
            entry['period'], np.array(entry['latencies']), entry['processors'], entry['skipped']
        )
        for name, entry in content.items()
    }


def to_text(processes: Mapping[str, int]) -> str:
    """Process numbers by name as a parameter of a node: a text, because ROS has no mappings and no
    empty arrays.
    """
    return ' '.join(f'{name}={number}' for name, number in processes.items())


def from_text(processes: str) -> dict[str, int]:
    """The same again."""
    return {
        name: int(number)
        for name, _, number in (entry.partition('=') for entry in processes.split())
    }
