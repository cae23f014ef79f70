"""The loop over DDS at several rates: the time from a state to its command."""

import math
import os
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.table import Table

from redres_ros.bench.timing import RoundTrips
from redres_ros.demo.log import stamped
from redres_ros.demo.processes import NodeProcess
from redres_ros.errors import RedresError
from redres_ros.graph.mcap_file import RecordedMessage, read_messages
from redres_ros.nodes.discovery import own_domain
from redres_ros.nodes.real_time import LATENCY
from redres_ros.simulation.report import table

REPETITIONS = 2  # of everything, so that a slow minute of the machine hits all alike
SETTLING = 2.0  # [s] from the first response to the first state that counts: by then the arm moves
_GRAPHS = {  # what runs together; the last process of each has the robot in it
    'bare echo node': ('bench.echo', 'sim'),
    'controller, standing still': ('controller', 'sim'),
    'planner, controller': ('planner', 'controller', 'sim'),
    'planner and controller in one process': ('composed --no-sim', 'sim'),
    'planner, controller and robot in one process': ('composed',),
    'bare echo node, kept awake': ('bench.echo', 'sim'),
    'planner, controller, kept awake': ('planner', 'controller', 'sim'),
    'planner and controller in one process, kept awake': ('composed --no-sim', 'sim'),
}

_AWAKE = ', kept awake'  # no processor sleeps
_PATIENCE = 120.0  # [s] for the first response; the first start compiles
_STRAGGLERS = 0.1  # [s] for which commands are awaited after the last state
_RECORDED = ('joint_states', 'joint_command')
# A real robot would leave command mode when this machine stalls, and the arm would stand still.
_ROBOT = {'bridged_misses': 100, 'patience': 0.0}
# Of the nodes of _GRAPHS: a task that goes on and on, and a robot that never waits.
PARAMETERS: dict[str, dict[str, Any]] = {
    'planner': {'autostart': True},
    'sim': _ROBOT,
    'composed': {'autostart': True, **_ROBOT},
    'composed --no-sim': {'autostart': True},
}


# [s] of /proc/<pid>/stat: Linux counts in hundredths for user space, whatever the kernel's HZ
_TICK = 0.01


@dataclass(frozen=True)
class LoopResult:
    """Round trips by rate [Hz] and by responder."""

    round_trips: Mapping[float, Mapping[str, RoundTrips]]

    def table(self) -> Table:
        """One line for each rate and responder."""
        heads = ('median', 'p99', 'p99.9', 'max')
        rows: list[tuple[str, ...]] = []
        for rate, kinds in self.round_trips.items():
            rows.append((f'{rate:g} Hz',))
            rows += [(name, *_cells(trips)) for name, trips in kinds.items()]
        return table(
            ('', *(f'{head} [us]' for head in heads), 'in cycle', 'lost', 'skipped', 'of a core'),
            rows,
            title='Loop: from a state to its response',
        )

    def figures(self) -> dict[str, object]:
        """For the file of results."""
        figures: dict[str, object] = {}
        for rate, kinds in self.round_trips.items():
            figures[f'{rate:g}_Hz'] = {name: trips.figures() for name, trips in kinds.items()}
        return figures


def graphs() -> dict[str, tuple[str, ...]]:
    """The entries of _GRAPHS that can run here."""
    if os.access(LATENCY, os.W_OK):
        return _GRAPHS
    return {name: nodes for name, nodes in _GRAPHS.items() if not name.endswith(_AWAKE)}


def measure_loop(
    rates: Sequence[float], duration: float, out: Path, progress: Callable[[float], None]
) -> LoopResult:
    """Measure everything at every rate, again and again.

    Args:
        rates: States per second [Hz].
        duration: For which each is measured at each rate, in all repetitions together [s].
        out: Directory for what the nodes print.
        progress: Called with the fraction done, 0 to 1.

    Raises:
        RedresError: A node does not run or does not respond.
    """
    steps = [(rate, name) for _ in range(REPETITIONS) for rate in rates for name in graphs()]
    parts: dict[tuple[float, str], list[RoundTrips]] = {step: [] for step in steps}
    for number, (rate, name) in enumerate(steps):
        parts[rate, name].append(_measure_graph(name, rate, duration / REPETITIONS, out))
        progress((number + 1) / len(steps))
    joined: dict[float, dict[str, RoundTrips]] = {rate: {} for rate in rates}
    for (rate, name), repetitions in parts.items():
        joined[rate][name] = RoundTrips.joined(repetitions)
    return LoopResult(joined)


def _measure_graph(name: str, rate: float, duration: float, out: Path) -> RoundTrips:
    recording = out / 'robot.mcap'
    with own_domain(), ExitStack() as stack:
        processes: dict[str, NodeProcess] = {}
        for node in _GRAPHS[name]:
            parameters: dict[str, Any] = {'rate': rate, **PARAMETERS.get(node, {})}
            with_robot = node == _GRAPHS[name][-1]
            if with_robot and name.endswith(_AWAKE):
                parameters['keep_awake'] = True
            processes[node] = NodeProcess(
                node,
                out / f'{node}.log',
                parameters,
                recording=recording if with_robot else None,
                topics=_RECORDED,
            )
            stack.callback(processes[node].end)
        _await_response(recording, processes)
        time.sleep(SETTLING)
        meter = ProcessorMeter({node: process.pid for node, process in processes.items()})
        begin = time.time()
        time.sleep(duration)
        end = time.time()
        fractions = meter.fractions()
        time.sleep(_STRAGGLERS)
        for process in processes.values():
            process.check()
    trips = round_trips(1.0 / rate, read_messages(recording), (begin, end), fractions)
    recording.unlink()
    return trips


def round_trips(
    period: float,
    messages: Iterable[RecordedMessage],
    window: tuple[float, float],
    processors: Mapping[str, float],
) -> RoundTrips:
    """Those of a recording of the robot.

    Args:
        period: At which states should go out [s].
        messages: The states that it published and the commands that it received.
        window: The instants between which states count, time of day [s].
        processors: Fraction of a core by name.
    """
    sent: dict[int, float] = {}
    returned: dict[int, float] = {}
    for stamp, message in stamped(messages):
        times = returned if message.is_received else sent
        times.setdefault(stamp, message.time / 1e9)
    counted = [stamp for stamp, at in sent.items() if window[0] <= at < window[1]]
    responses = [returned.get(stamp, math.inf) for stamp in counted]
    return RoundTrips.from_times(period, [sent[stamp] for stamp in counted], responses, processors)


def _await_response(recording: Path, processes: Mapping[str, NodeProcess]) -> None:
    until = time.monotonic() + _PATIENCE
    while not (recording.exists() and any(m.is_received for m in read_messages(recording))):
        for process in processes.values():
            process.check()
        if time.monotonic() > until:
            names = ' and '.join(processes)
            raise RedresError(f'{names} did not respond within {_PATIENCE:g} s')
        time.sleep(0.1)


def _cells(trips: RoundTrips) -> list[str]:
    cells = [f'{1e6 * trips.times.quantile(fraction):.0f}' for fraction in (0.5, 0.99, 0.999, 1.0)]
    fractions = [f'{name} {fraction:.0%}' for name, fraction in trips.processors.items()]
    return [
        *cells,
        f'{trips.in_cycle:.2%}',
        f'{trips.lost:.2%}',
        str(trips.skipped),
        ', '.join(fractions),
    ]


class ProcessorMeter:
    """Fraction of a core that processes take, from the moment when it is made.

    Args:
        processes: Their numbers by name.
    """

    def __init__(self, processes: Mapping[str, int]) -> None:
        self._processes = dict(processes)
        self._begun = time.perf_counter()
        self._before = self._seconds()

    def fractions(self) -> dict[str, float]:
        """Mean since then, by name."""
        elapsed = time.perf_counter() - self._begun
        after = self._seconds()
        return {name: (after[name] - self._before[name]) / elapsed for name in after}

    def _seconds(self) -> dict[str, float]:
        return {name: processor_seconds(pid) for name, pid in self._processes.items()}


def processor_seconds(pid: int) -> float:
    """Processor time of a process so far, all its threads, in user space and the kernel [s]; NaN if
    it is gone.
    """
    try:
        fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    except OSError:
        return float('nan')
    return (int(fields[11]) + int(fields[12])) * _TICK  # utime and stime, see proc(5)
