"""A node's health: a log line when an event begins and one when it ends, and /diagnostics."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

from redres_ros.errors import one_line
from redres_ros.nodes.clocks import create_steady_timer
from redres_ros.nodes.topics import PUBLISH

OK = DiagnosticStatus.OK
WARN = DiagnosticStatus.WARN
ERROR = DiagnosticStatus.ERROR

_QUIET = 1.0  # [s] an event is over when it has not recurred for that long
_LOOK = 0.25  # [s] between looks at that


class Health(NamedTuple):
    """Level, one line in words, and figures by name."""

    level: bytes
    summary: str
    figures: Mapping[str, object]


class Diagnostics:
    """Publishes what `health()` gives on /diagnostics, once a second.

    Args:
        node: Node whose health is published.
        hardware: The robot's name.
        health: Asked once a second.
    """

    def __init__(self, node: Node, hardware: str, health: Callable[[], Health]) -> None:
        self._node = node
        self._hardware = hardware
        self._health = health
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', PUBLISH)
        create_steady_timer(node, 1.0, self.publish)

    def publish(self) -> None:
        """Publish now."""
        level, summary, figures = self._health()
        values = [KeyValue(key=key, value=_to_text(value)) for key, value in figures.items()]
        status = DiagnosticStatus(
            level=level,
            name=self._node.get_fully_qualified_name(),
            message=summary,
            values=values,
            hardware_id=self._hardware,
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)


def _to_text(value: object) -> str:
    return f'{value:g}' if isinstance(value, float) else str(value)


@dataclass
class _Episode:
    """A time in which inputs of a source are refused; some may be accepted meanwhile.

    Attributes:
        reason: The newest.
        count: Number of refused inputs.
        last: When the last one came [s].
        over: Whether an input could be used since.
        kinds: Kinds of errors, each of which is reported once.
    """

    reason: str = ''
    count: int = 0
    last: float = 0.0
    over: bool = False
    kinds: set[type[Exception]] = field(default_factory=set)


class InputMonitor:
    """Logs when inputs of a source are refused, for a new reason too, and when no longer."""

    def __init__(self, node: Node) -> None:
        self._logger = node.get_logger()
        self._bad: dict[str, _Episode] = {}
        self.count = 0
        create_steady_timer(node, _LOOK, self._look)

    def refuse(self, source: str, error: Exception) -> None:
        """Count an input that cannot be used.

        Args:
            source: The topic.
            error: What was got and what is allowed.
        """
        self.count += 1
        episode = self._bad.setdefault(source, _Episode())
        episode.reason = one_line(str(error))
        episode.count += 1
        episode.last = time.monotonic()
        episode.over = False
        if type(error) not in episode.kinds:
            episode.kinds.add(type(error))
            self._logger.error(f'{source} refused: {episode.reason}')

    def accept(self, source: str) -> None:
        """Note an input that could be used."""
        if source in self._bad:
            self._bad[source].over = True

    @property
    def reasons(self) -> str:
        """What is bad at present, or was a moment ago, and why; empty when all is well."""
        return ', '.join(f'{source} refused: {bad.reason}' for source, bad in self._bad.items())

    def _look(self) -> None:
        now = time.monotonic()
        for source, episode in list(self._bad.items()):
            if episode.over and now - episode.last > _QUIET:
                del self._bad[source]
                self._logger.info(f'{source} accepted again after {episode.count} refused')


class Watchdog:
    """Notices the silence of a topic by the monotonic clock; logs its beginning and its end.

    Args:
        node: Node whose log is used.
        topic: Its name in the log.
        timeout: Silence that is reported [s].
    """

    def __init__(self, node: Node, topic: str, timeout: float) -> None:
        self._logger = node.get_logger()
        self._topic = topic
        self._timeout = timeout
        self._last = time.monotonic()
        self._last_silence = self._last
        self._reported = False
        self.silent = False
        create_steady_timer(node, timeout / 2.0, self._look)

    def feed(self) -> None:
        """A message has come."""
        now = time.monotonic()
        if now - self._last > self._timeout:
            self._last_silence = now  # which the timer may have missed if the machine stalled
        self._last = now
        self.silent = False

    def _look(self) -> None:
        now = time.monotonic()
        self.silent = now - self._last > self._timeout
        if self.silent:
            self._last_silence = now
            if not self._reported:
                self._reported = True
                self._logger.warning(f'no {self._topic} for {self._timeout:g} s')
        elif self._reported and now - self._last_silence > _QUIET:
            self._reported = False
            self._logger.info(f'{self._topic} is back')
