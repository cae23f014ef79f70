"""What was heard of a running graph, and when."""

from dataclasses import dataclass
from typing import NamedTuple

STALE = 3.0  # [s] a node that is silent for longer has gone: it sends diagnostics once a second


@dataclass(frozen=True)
class LastValue:
    """A value, and the instant [s] at which it came."""

    value: object
    at: float


class NodeHealth(NamedTuple):
    """What a node says of itself, and whether all is well."""

    text: str
    is_well: bool
