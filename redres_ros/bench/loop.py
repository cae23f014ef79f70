"""Runs the loop over DDS at several rates: echoes and controllers in turn, then the whole graph,
again and again.
"""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from redres_ros.bench.exchange import Exchange
from redres_ros.bench.loop_result import (
    COMPOSED,
    CONTROLLER,
    ECHO,
    GRAPH,
    INSIDE,
    NOMINAL,
    UDP,
    WEIGHTED,
    LoopResult,
)
from redres_ros.bench.results import read_exchanges, to_text
from redres_ros.bench.udp import echo_process
from redres_ros.demo.processes import NodeProcess, own_domain
from redres_ros.errors import RedresError

REPETITIONS = 2  # of everything, so that a slow minute of the machine hits all alike
TURNS = 2  # of each answerer within a repetition
SETTLING = 1.0  # [s] from the graph's first answer to the first state that counts

_PATIENCE = 60.0  # [s] beyond the time that the measurement itself takes
# A real robot would leave command mode when this machine stalls; the states would go on, but not
# the motion.
_ROBOT = {'bridged_misses': 100}


class BenchError(RedresError):
    """A measurement that did not come about."""


def measure_loop(
    rates: Sequence[float],
    duration: float,
    out: Path,
    progress: Callable[[float], None] | None = None,
) -> LoopResult:
    """Every kind for `duration` [s] at every rate [Hz]; the nodes' logs go to the directory out.

    Raises GraphError or BenchError when a node does not run.
    """
    parts: dict[float, dict[str, list[Exchange]]] = {rate: {} for rate in rates}
    steps = [
        (rate, measure)
        for _ in range(REPETITIONS)
        for rate in rates
        for measure in (_lanes, _graph, _composed)
    ]
    for number, (rate, measure) in enumerate(steps):
        with own_domain():
            for kind, exchange in measure(rate, duration / REPETITIONS, out).items():
                parts[rate].setdefault(kind, []).append(exchange)
        if progress:
            progress((number + 1) / len(steps))
    return LoopResult(
        {
            rate: {kind: Exchange.joined(exchanges) for kind, exchanges in kinds.items()}
            for rate, kinds in parts.items()
        }
    )


def _lanes(rate: float, duration: float, out: Path) -> dict[str, Exchange]:
    """UDP, echo and controllers, in turn, by one bare robot: whoever waits for its turn costs next
    to nothing.
    """
    with ExitStack() as stack:
        udp, port = stack.enter_context(echo_process())
        nodes = {ECHO: stack.enter_context(running('bench.echo', out, namespace=ECHO))}
        for kind, law in _laws(rate).items():
            parameters = {'rate': rate, 'law': law, 'state_timeout': 10.0}
            nodes[kind] = stack.enter_context(running(CONTROLLER, out, parameters, namespace=kind))
        answerers = {UDP: udp, INSIDE: 0, **{kind: node.pid for kind, node in nodes.items()}}
        return measured(
            'bench.driver',
            out,
            duration,
            {
                'rate': rate,
                'duration': duration / TURNS,
                'turns': TURNS,
                'answerers': to_text(answerers),
                'udp_port': port,
            },
        )


def _laws(rate: float) -> dict[str, str]:
    """The default law at every rate; one with a weight, which differs by little, where the goals
    are.
    """
    laws = {CONTROLLER: 'minimum_acceleration', WEIGHTED: 'dynamically_consistent'}
    return laws if rate == NOMINAL else {CONTROLLER: laws[CONTROLLER]}


def _graph(rate: float, duration: float, out: Path) -> dict[str, Exchange]:
    """Robot, planner and controller as three processes."""
    with (
        running('controller', out, {'rate': rate}) as controller,
        running('planner', out, {'autostart': True}) as planner,
    ):
        processes = {'planner': planner.pid, 'controller': controller.pid}
        exchanges = measured(
            'bench.sim',
            out,
            duration,
            {
                'rate': rate,
                'duration': duration,
                'settling': SETTLING,
                'processes': to_text(processes),
                **_ROBOT,
            },
        )
    return {GRAPH: exchanges['sim']}


def _composed(rate: float, duration: float, out: Path) -> dict[str, Exchange]:
    """The three of them in one process."""
    exchanges = measured(
        'bench.composed',
        out,
        duration,
        {
            'rate': rate,
            'duration': duration,
            'settling': SETTLING,
            'own_name': COMPOSED,
            'autostart': True,
            **_ROBOT,
        },
    )
    return {COMPOSED: exchanges['sim']}


@contextmanager
def running(
    name: str, out: Path, parameters: Mapping[str, Any] | None = None, namespace: str = ''
) -> Iterator[NodeProcess]:
    """A node while the block lasts."""
    node = NodeProcess(
        name, out / f'{"_".join(filter(None, (namespace, name)))}.log', parameters or {}, namespace
    )
    try:
        yield node
    finally:
        node.end()


def measured(
    name: str, out: Path, duration: float, parameters: Mapping[str, Any]
) -> dict[str, Exchange]:
    """What a node that measures has written when it has ended by itself. Raises BenchError or
    GraphError.
    """
    results = out / f'{name}.json'
    until = time.monotonic() + 10.0 * duration + _PATIENCE
    results.unlink(missing_ok=True)
    with running(name, out, {**parameters, 'out': str(results)}) as node:
        while node.status is None:
            if time.monotonic() > until:
                raise BenchError(f'{name} did not come to an end; see {out}/*.log')
            time.sleep(0.05)
        if node.status:
            node.check()
    return read_exchanges(results)
