"""Node `sim` as it is, but with a stopwatch."""

import os
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

from sensor_msgs.msg import JointState

from redres_ros.bench.exchange import ProcessorMeter, Stopwatch
from redres_ros.bench.results import from_text, write_exchanges
from redres_ros.nodes.conversions import to_nanoseconds
from redres_ros.nodes.parameters import declare
from redres_ros.nodes.runtime import Waiting, run_nodes
from redres_ros.nodes.sim import SimNode
from redres_ros.parameter import param

_STRAGGLERS = 0.1  # [s] for which answers are awaited after the last state that counts


@dataclass(frozen=True)
class Window:
    """What is measured."""

    settling: float = param(
        1.0, 'from the first answer to the first state that counts [s]', 0.0, 60.0
    )
    duration: float = param(2.0, 'from the first to the last state that counts [s]', 0.01, 3600.0)
    processes: str = param('', 'NAME=PROCESS ... of the others whose processor time is measured')
    own_name: str = param('sim', 'what this process is called in the results')
    out: str = param('sim.json', 'file for the results; {arm} stands for the namespace')
    stay: bool = param(False, 'go on after the window, as a load for others')


class MeasuredSim(SimNode):
    """Writes its latencies when the window is over, and ends unless it is to stay."""

    def __init__(self) -> None:
        super().__init__()
        self._window = declare(self, Window())
        self._stopwatch = Stopwatch(0, 0)
        self._meter = None
        self._begin = self._end = -1  # ticks; negative until the first answer has come

    def run(self, stopped: threading.Event, waiting: Waiting) -> None:
        """As ever, and until the window is over."""
        self._over = stopped
        self._waiting = waiting
        super().run(stopped, waiting)

    def _publish_state(self) -> None:
        tick = self._robot.tick
        if tick == self._begin:
            processes = from_text(self._window.processes) | {self._window.own_name: os.getpid()}
            self._meter = ProcessorMeter(processes)
        if tick == self._end:
            self._finish()
        super()._publish_state()
        # The message was made before it went out: for the driver, with which this is compared, that
        # does not count.
        self._stopwatch.out(tick, ago=self._robot_clock.latency(tick, time.monotonic()))

    def _on_command(self, message: JointState) -> None:
        tick = self._robot_clock.tick(to_nanoseconds(message.header.stamp))
        self._stopwatch.back(tick)
        if self._end < 0:
            rate = self._settings.rate
            self._begin = self._robot.tick + round(self._window.settling * rate) + 2
            self._end = self._begin + max(round(self._window.duration * rate), 1)
            self._stopwatch = Stopwatch(self._begin, self._end - self._begin)
        super()._on_command(message)

    def _finish(self) -> None:
        shares = self._meter.shares()
        self._waiting.sleep(_STRAGGLERS)
        exchange = self._stopwatch.exchange(1.0 / self._settings.rate, shares)
        write_exchanges(
            {'sim': exchange}, Path(self._window.out.format(arm=self.get_namespace().strip('/')))
        )
        if not self._window.stay:
            self._over.set()


if __name__ == '__main__':
    sys.exit(run_nodes(MeasuredSim, one_thread=True))
