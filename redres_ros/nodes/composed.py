"""Executable `composed`: the nodes sim, controller and planner in one process, for the shortest way between them."""

import sys

from redres_ros.nodes.controller import ControllerNode
from redres_ros.nodes.planner import PlannerNode
from redres_ros.nodes.runtime import run_nodes
from redres_ros.nodes.sim import SimNode


def main(arguments: list[str] | None = None) -> int:
    """Console entry point."""
    return run_nodes(SimNode, ControllerNode, PlannerNode, arguments=arguments)


if __name__ == '__main__':
    sys.exit(main())
