"""Executable `composed`: the nodes sim, controller and planner in one process and one thread.

States, commands and task velocities are handed over directly, not through DDS. Other processes can
still listen, and send task velocities.
"""

import sys
from collections.abc import Callable

from rclpy.node import Node

from redres_ros.nodes.controller import ControllerNode
from redres_ros.nodes.intra_process import IntraProcess
from redres_ros.nodes.planner import PlannerNode
from redres_ros.nodes.runtime import run_nodes
from redres_ros.nodes.sim import SimNode


def run_composed(
    adapt: Callable[[type[Node]], type[Node]] = lambda cls: cls,
    arguments: list[str] | None = None,
) -> int:
    """Run the three until they are asked to end; the controller gets a state before the
    planner gets it.

    Args:
        adapt: what is made of each node's class before a node is made of it.
        arguments: the command line; None for that of the process.

    Returns:
        The exit status.
    """
    intra_process = IntraProcess(
        ('joint_states', 'joint_command', 'controller/task_scaling'),
        open_topics=('cartesian_velocity',),
    )
    classes = [adapt(cls) for cls in (SimNode, ControllerNode, PlannerNode)]
    return run_nodes(*map(intra_process.node, classes), arguments=arguments, one_thread=True)


def main(arguments: list[str] | None = None) -> int:
    """Console entry point."""
    return run_composed(arguments=arguments)


if __name__ == '__main__':
    sys.exit(main())
