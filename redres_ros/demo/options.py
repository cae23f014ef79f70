"""The options of a run of the demo."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from redres_ros.errors import RedresError


class DemoError(RedresError):
    """A run that could not begin, or failed."""


@dataclass(frozen=True)
class DemoOptions:
    """The options of a run.

    Attributes:
        task: Its name.
        law: Name of the law at the start.
        rate: Cycles a second [Hz].
        dynamics: Of the fake arm and of the controller's model.
        switches: (law, seconds after the task began).
        lockstep: As fast as it goes, instead of in real time.
        composed: One process instead of three.
        duration: How long the task is repeated [s]; 0 for once.
        teleop: How long an operator steers in place of a task [s]; 0 for a task.
        page: Parameters of the page, with which the nodes stay until Ctrl-C; None for no page.
        mcap: File for all that the nodes publish; None for none.
        parameters: More of them, for every node that has them.
    """

    task: str
    law: str
    rate: float
    dynamics: str = 'identified'
    switches: tuple[tuple[str, float], ...] = ()
    lockstep: bool = False
    composed: bool = False
    duration: float = 0.0
    teleop: float = 0.0
    page: Mapping[str, Any] | None = None
    mcap: Path | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict)
