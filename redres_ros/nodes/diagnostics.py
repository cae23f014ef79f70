"""What a node tells about its health: one log line an event, and /diagnostics once a second."""

import time
from collections.abc import Callable
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

from redres_ros.nodes.qos import PUBLISH

OK = DiagnosticStatus.OK
WARN = DiagnosticStatus.WARN
ERROR = DiagnosticStatus.ERROR


class Health(NamedTuple):
    """Level, one line in words, and figures by name."""

    level: bytes
    summary: str
    figures: dict[str, object]


class Diagnostics:
    """Publishes what `health()` gives on /diagnostics, once a second."""

    def __init__(self, node: Node, hardware: str, health: Callable[[], Health]) -> None:
        self._node = node
        self._hardware = hardware
        self._health = health
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', PUBLISH)
        node.create_timer(1.0, self.publish)

    def publish(self) -> None:
        """Publish now."""
        level, summary, figures = self._health()
        values = [
            KeyValue(key=key, value=f'{value:g}' if isinstance(value, float) else str(value))
            for key, value in figures.items()
        ]
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


class Refusals:
    """Input that was refused: a log line when a source turns bad, or bad in another way, and one
    when it is good.
    """

    def __init__(self, node: Node) -> None:
        self._logger = node.get_logger()
        self._bad = {}
        self.count = 0

    def refuse(self, source: str, error: Exception) -> None:
        """Count an input that cannot be used."""
        self.count += 1
        kind, since = self._bad.get(source, (None, self.count))
        if kind is not type(error):
            self._logger.error(f'{source} refused: {error}')
        self._bad[source] = (type(error), since)

    def accept(self, source: str) -> None:
        """Note an input that could be used."""
        if source in self._bad:
            _, since = self._bad.pop(source)
            self._logger.info(f'{source} accepted again after {self.count - since + 1} refused')

    @property
    def reasons(self) -> str:
        """Sources that are bad at present; empty when all is well."""
        return ', '.join(f'{source} refused' for source in self._bad)


class Watchdog:
    """Notices the silence of a topic by the monotonic clock; logs when it falls silent and when it
    is back.
    """

    def __init__(self, node: Node, topic: str, timeout: float) -> None:
        self._logger = node.get_logger()
        self._topic = topic
        self._timeout = timeout
        self._last = time.monotonic()
        self.silent = False
        node.create_timer(timeout / 2.0, self._look)

    def feed(self) -> None:
        """A message has come."""
        self._last = time.monotonic()
        if self.silent:
            self.silent = False
            self._logger.info(f'{self._topic} is back')

    def _look(self) -> None:
        if not self.silent and time.monotonic() - self._last > self._timeout:
            self.silent = True
            self._logger.warning(f'no {self._topic} for {self._timeout:g} s')
