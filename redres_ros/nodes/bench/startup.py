"""Programs that make the nodes of one process and end, for how long that takes."""

from collections.abc import Callable

from redres_ros.experiments.bench.startup import StartupResult, measure_startup
from redres_ros.nodes.graph import own_domain

_NODES = {'controller': 'ControllerNode', 'planner': 'PlannerNode', 'sim': 'SimNode'}


def measure_nodes(repetitions: int, progress: Callable[[float], None] | None = None) -> StartupResult:
    """The start of each node and of all three in one process, beside that of `redres --help`."""
    programs = {f'node {name}': _program({name: node}) for name, node in _NODES.items()}
    with own_domain():
        return measure_startup({**programs, 'all three in one process': _program(_NODES)}, repetitions, progress)


def _program(nodes: dict[str, str]) -> str:
    """Python that makes nodes; what comes after that, and taking leave, does not count."""
    imports = ''.join(f'from redres_ros.nodes.{name} import {node}\n' for name, node in nodes.items())
    makes = ''.join(f'{node}(),' for node in nodes.values())
    return f'import os\nfrom redres_ros.nodes.runtime import start\n{imports}start()\nnodes = [{makes}]\nos._exit(0)'
