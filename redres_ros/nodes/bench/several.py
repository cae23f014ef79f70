"""How many arms hold their rate on two cores, in one process and in several."""

import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from redres_ros.experiments.bench.arms import ALL_IN_ONE, ONE_EACH, THREE_EACH, ArmsResult
from redres_ros.experiments.bench.exchange import Exchange
from redres_ros.nodes.bench.arms import ARMS
from redres_ros.nodes.bench.loop import BenchError, running
from redres_ros.nodes.bench.results import read_exchanges
from redres_ros.nodes.graph import NodeProcess, own_domain

MOST = 4  # arms
CORES = 2
HOPELESS = 0.9  # share of the cycles below which more arms are not tried

_START = 1.0  # [s] of processor time that a process takes to start, about
_PATIENCE = 60.0  # [s] for the results beyond the time that it all takes


def measure_arms(rate: float, duration: float, out: Path, most: int = MOST,
                 progress: Callable[[float], None] | None = None) -> ArmsResult:
    """One arm, two, and so on, for `duration` [s] at `rate` [Hz], in each of three ways; logs go to the directory out.

    Raises GraphError or BenchError when a node does not run.
    """
    exchanges: dict[str, dict[int, list[Exchange]]] = {way: {} for way in _WAYS}
    for number, way in enumerate(_WAYS):
        for count in range(1, most + 1):
            exchanges[way][count] = measure_one(way, count, rate, duration, out)
            if progress:
                progress((number + count / most) / len(_WAYS))
            if min(exchange.kept for exchange in exchanges[way][count]) < HOPELESS:
                break
    return ArmsResult(rate, exchanges)


def measure_one(way: str, count: int, rate: float, duration: float, out: Path) -> list[Exchange]:
    """One exchange an arm, for so many arms in one of the ways."""
    arms = [f'arm{number}' for number in range(count)]
    files = [out / f'{arm}.json' for arm in arms]
    for file in files:
        file.unlink(missing_ok=True)
    shared = {'rate': rate, 'duration': duration, 'stay': True, 'autostart': True, 'out': str(out / '{arm}.json'),
              'bridged_misses': 100}
    with own_domain(), _two_cores(), ExitStack() as stack:
        def run(name: str, namespace: str = '', processes: int = 1) -> NodeProcess:
            settling = 1.0 + _START * processes  # all must have started before the first one measures
            return stack.enter_context(running(name, out, {**shared, 'settling': settling}, namespace))

        _await(files, _WAYS[way](run, arms), duration)
    return [read_exchanges(file)['sim'] for file in files]


def _all_in_one(run: Callable[..., NodeProcess], arms: Sequence[str]) -> list[NodeProcess]:
    os.environ[ARMS] = ' '.join(arms)  # until own_domain puts the environment back
    return [run('bench.arms')]


def _one_each(run: Callable[..., NodeProcess], arms: Sequence[str]) -> list[NodeProcess]:
    return [run('bench.composed', arm, len(arms)) for arm in arms]


def _three_each(run: Callable[..., NodeProcess], arms: Sequence[str]) -> list[NodeProcess]:
    return [run(name, arm, 3 * len(arms)) for arm in arms for name in ('controller', 'planner', 'bench.sim')]


_WAYS = {ALL_IN_ONE: _all_in_one, ONE_EACH: _one_each, THREE_EACH: _three_each}


@contextmanager
def _two_cores() -> Iterator[None]:
    """Whatever is started meanwhile shares two cores."""
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, sorted(allowed)[:CORES])
    try:
        yield
    finally:
        os.sched_setaffinity(0, allowed)


def _await(files: Sequence[Path], nodes: Sequence[NodeProcess], duration: float) -> None:
    until = time.monotonic() + 10.0 * duration + _PATIENCE
    while not all(file.exists() for file in files):
        for node in nodes:
            node.check()
        if time.monotonic() > until:
            raise BenchError(f'{len(files)} arms did not come to an end; see {files[0].parent}/*.log')
        time.sleep(0.05)
