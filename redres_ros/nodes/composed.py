"""Executable `composed`: the nodes sim, controller and planner in one process and one thread.

States, commands and task velocities are handed over without a way through DDS, on which others can
still listen, and send task velocities.
"""

import sys

from rclpy.node import Node

from redres_ros.nodes.controller import ControllerNode
from redres_ros.nodes.intra_process import IntraProcess
from redres_ros.nodes.planner import PlannerNode
from redres_ros.nodes.runtime import run_nodes
from redres_ros.nodes.sim import SimNode


def run_composed(sim: type[Node] = SimNode, arguments: list[str] | None = None) -> int:
    """The exit status of the three; a state is answered by the controller before the planner gets
    it.
    """
    intra_process = IntraProcess(
        ('joint_states', 'joint_command'), open_topics=('cartesian_velocity',)
    )
    return run_nodes(
        *map(intra_process.node, (sim, ControllerNode, PlannerNode)),
        arguments=arguments,
        one_thread=True,
    )


def main(arguments: list[str] | None = None) -> int:
    """Console entry point."""
    return run_composed(arguments=arguments)


if __name__ == '__main__':
    sys.exit(main())
