"""A node's health: a log line when an event begins and one when it ends, and /diagnostics."""

import math
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from redres_ros.errors import RedresError, one_line
from redres_ros.nodes.lifecycle import ManagedNode
from redres_ros.nodes.topics import PUBLISH, STEADY
from redres_ros.types import Seconds

_QUIET = 1.0  # [s] an event is over when it has not recurred for that long
_LOOK = 0.05  # [s] between looks at that
_SILENCE = 0.1  # [s] without states that is reported, and at least as many cycles as
_SILENT_CYCLES = 10
_STARTING = 3.0  # [s] that a robot may take to start beside this node
_STATES = 'states of the robot'


class Health(NamedTuple):
    """Values by name, and in words: an error, a warning, or else the state."""

    values: Mapping[str, object]
    state: str
    warning: str = ''
    error: str = ''


@dataclass
class _Episode:
    """A time in which something is wrong with what comes; some of it may be accepted meanwhile."""

    problem: str = ''  # the newest
    last: Seconds = 0.0
    over: bool = False  # something could be used since
    reported: set[object] = field(default_factory=set)  # kinds of problems


class Diagnostics:
    """Logs when inputs are refused, for a new kind of error too, when joint_states is silent, and
    when no longer; publishes that, and what `health()` returns, on /diagnostics once a second.

    Without a rate, as in lock-step, where states wait for commands, no silence is too long.
    """

    def __init__(
        self,
        node: ManagedNode,
        hardware: str,
        health: Callable[[], Health],
        rate: float | None = None,
    ) -> None:
        self._node = node
        self._logger = node.get_logger()
        self._hardware = hardware
        self._health = health
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', PUBLISH)
        self._bad: dict[str, _Episode] = {}
        self._refused = 0
        self._longest = max(_SILENCE, _SILENT_CYCLES / rate) if rate else math.inf  # [s]
        self._fed_at = time.monotonic() + _STARTING
        node.create_timer(_LOOK, self._look, clock=STEADY)
        node.create_timer(1.0, self.publish, clock=STEADY)

    def publish(self) -> None:
        values, state, warning, error = self._health()
        inactive = '' if self._node.active else self._node.life
        error = 'no joint_states' if self.silent else error
        refused = ', '.join(episode.problem for episode in self._bad.values())
        warning = refused or inactive or warning
        level = DiagnosticStatus.WARN if warning else DiagnosticStatus.OK
        values = {**values, 'messages refused': self._refused}
        status = DiagnosticStatus(
            level=DiagnosticStatus.ERROR if error else level,
            name=self._node.get_fully_qualified_name(),
            message=error or warning or state,
            values=[KeyValue(key=key, value=_to_text(value)) for key, value in values.items()],
            hardware_id=self._hardware,
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)

    def refuse(self, source: str, error: Exception) -> None:
        """Count an input of a topic or service that cannot be used."""
        self._refused += 1
        self._note(source, f'{source} refused: {one_line(str(error))}', type(error))

    def accept(self, source: str) -> None:
        """Note an input that could be used."""
        if source in self._bad:
            self._bad[source].over = True

    @contextmanager
    def judging(self, source: str) -> Iterator[None]:
        """Refuse an input for a RedresError in the block, else accept it."""
        try:
            yield
        except RedresError as error:
            self.refuse(source, error)
        else:
            self.accept(source)

    @property
    def silent(self) -> bool:
        """Whether the last state came too long ago."""
        return time.monotonic() - self._fed_at > self._longest

    @property
    def was_silent(self) -> bool:
        """Whether the last state came too long ago, or one did a moment ago."""
        return self.silent or _STATES in self._bad

    def feed(self) -> None:
        self._fed_at = time.monotonic()
        self.accept(_STATES)

    def _look(self) -> None:
        if self.silent:
            self._note(_STATES, f'no joint_states for {self._longest:g} s', _STATES)
        for source, episode in list(self._bad.items()):
            if episode.over and time.monotonic() - episode.last > _QUIET:
                del self._bad[source]
                self._logger.info(f'{source} accepted again')

    def _note(self, source: str, problem: str, kind: object) -> None:
        episode = self._bad.setdefault(source, _Episode())
        episode.problem = problem
        episode.last = time.monotonic()
        episode.over = False
        if kind not in episode.reported:
            episode.reported.add(kind)
            self._logger.error(problem)


def _to_text(value: object) -> str:
    return f'{value:g}' if isinstance(value, float) else str(value)
