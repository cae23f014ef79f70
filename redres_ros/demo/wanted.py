"""What a run of the demo is to be, and how it ended."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from redres_ros.demo.outcome import Endurance
from redres_ros.errors import RedresError


class DemoError(RedresError):
    """A run that came to nothing."""


@dataclass(frozen=True)
class DemoOptions:
    """What to run.

    dynamics: of the fake arm and of the controller's model; switches: (law, seconds after the task
    began); parameters: more of them, for every node that has them; composed: one process instead of
    three; duration [s]: repeat the task for so long, 0 for once; views: modules of this package
    that show the nodes, with their parameters, and for which the nodes stay until Ctrl-C; mcap:
    file for all that the nodes say.
    """

    task: str
    law: str
    rate: float
    dynamics: str = 'identified'
    switches: tuple[tuple[str, float], ...] = ()
    lockstep: bool = False
    composed: bool = False
    duration: float = 0.0
    views: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    mcap: Path | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Ending:
    """How a run ended.

    endurance: where the task was repeated to the end; interrupted: by Ctrl-C; last: stamp of the
    last state that counts [ns].
    """

    endurance: Endurance | None
    interrupted: bool
    last: float = math.inf
