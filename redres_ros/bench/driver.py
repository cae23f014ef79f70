"""Node `driver`: a bare robot that sends states to several answerers in turn, and writes down how
they answer.
"""

import os
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

from rclpy.node import Node

from redres_ros.bench.echo import echo
from redres_ros.bench.exchange import Exchange, ProcessorMeter, Stopwatch
from redres_ros.bench.lanes import Lane, TopicLane, UdpLane
from redres_ros.bench.loop_result import INSIDE, UDP
from redres_ros.bench.results import from_text, write_exchanges
from redres_ros.errors import RedresError
from redres_ros.fri.robot_clock import NANOSECONDS, RobotClock
from redres_ros.nodes.parameters import declare
from redres_ros.nodes.runtime import Waiting, run_nodes
from redres_ros.parameter import param

WARM_UP = 0.3  # [s] of every turn that are not counted
STRAGGLERS = 0.1  # [s] for which answers are awaited after the last state of a turn
PATIENCE = 30.0  # [s] for an answerer to start


class DriverError(RedresError):
    """Somebody who should answer does not."""


@dataclass(frozen=True)
class DriverParameters:
    """Parameters of the node."""

    rate: float = param(500.0, 'states per second [Hz]', 10.0, 2000.0)
    duration: float = param(1.0, 'length of a turn [s]', 0.01, 3600.0)
    turns: int = param(2, 'how often it is the turn of each', 1, 1000)
    answerers: str = param('', 'NAMESPACE=PROCESS ...; udp is no namespace, 0 is this process')
    udp_port: int = param(0, 'of the echo over UDP', 0, 65535)
    out: str = param('driver.json', 'file for the results')


class DriverNode(Node):
    """Keeps an absolute schedule, as the robot does."""

    def __init__(self) -> None:
        super().__init__('driver')
        self._settings = declare(self, DriverParameters())
        self._period = round(NANOSECONDS / self._settings.rate)
        self._processes = from_text(self._settings.answerers)
        self._lanes: dict[str, Lane] = {name: self._lane(name) for name in self._processes}
        self._ticks = dict.fromkeys(self._lanes, 0)  # states sent so far

    def run(self, stopped: threading.Event, waiting: Waiting) -> None:
        """Turn after turn, then write the results."""
        exchanges: dict[str, list[Exchange]] = {name: [] for name in self._lanes}
        for name in self._lanes:
            self._await(name, stopped)
        for _ in range(self._settings.turns):
            for name in self._lanes:
                if not stopped.is_set():
                    exchanges[name].append(self._turn(name))
        if not stopped.is_set():
            write_exchanges(
                {name: Exchange.joined(parts) for name, parts in exchanges.items()},
                Path(self._settings.out),
            )

    def _lane(self, name: str) -> Lane:
        if name == INSIDE:
            echo(self, f'{name}/')
        return (
            UdpLane(self._settings.udp_port) if name == UDP else TopicLane(self, name, self._period)
        )

    def _await(self, name: str, stopped: threading.Event) -> None:
        """Send states until one is answered. Raises DriverError if none is."""
        until = time.monotonic() + PATIENCE
        while not stopped.is_set():
            self._send(name, 0.02)
            time.sleep(0.02)
            if self._lanes[name].stopwatch.latencies.min() < float('inf'):
                return
            if time.monotonic() > until:
                raise DriverError(f'{name} did not answer within {PATIENCE:g} s')

    def _turn(self, name: str) -> Exchange:
        self._send(name, WARM_UP)
        meter = ProcessorMeter({name: self._processes[name] or os.getpid()})
        self._send(name, self._settings.duration)
        shares = meter.shares()
        time.sleep(STRAGGLERS)
        return self._lanes[name].stopwatch.exchange(self._period / NANOSECONDS, shares)

    def _send(self, name: str, seconds: float) -> None:
        """States for that long, with a new stopwatch."""
        lane = self._lanes[name]
        first = self._ticks[name]
        count = max(round(seconds * NANOSECONDS / self._period), 1)
        lane.stopwatch = Stopwatch(first, count)
        clock = RobotClock(0, self._period)
        for tick in range(first, first + count):
            lane.send(tick)
            clock.wait()
        self._ticks[name] = first + count


if __name__ == '__main__':
    sys.exit(run_nodes(DriverNode))
