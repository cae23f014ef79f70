"""Executable `composed`: the nodes sim, controller and planner in one process and one executor.

With --no-sim there is no sim: a robot publishes the states and receives the commands.
"""

import sys

from redres_ros.nodes.controller import ControllerNode
from redres_ros.nodes.planner import PlannerNode
from redres_ros.nodes.runtime import run_nodes

_NO_SIM = '--no-sim'


def main(arguments: list[str] | None = None) -> int:
    """Console entry point."""
    given = sys.argv if arguments is None else arguments
    if _NO_SIM in given:
        return run_nodes(ControllerNode, PlannerNode, arguments=arguments)
    from redres_ros.nodes.sim import SimNode  # needs MuJoCo

    return run_nodes(SimNode, ControllerNode, PlannerNode, arguments=arguments)


if __name__ == '__main__':
    sys.exit(main())
