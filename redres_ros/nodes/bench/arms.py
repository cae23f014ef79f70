"""Executable: robot, planner and controller of several arms in one process, each arm in a namespace of its own."""

import os
import sys
import threading
from functools import partial

from rclpy.node import Node

from redres_ros.nodes.bench.sim import MeasuredSim
from redres_ros.nodes.controller import ControllerNode
from redres_ros.nodes.planner import PlannerNode
from redres_ros.nodes.runtime import Waiting, run_nodes

ARMS = 'REDRES_BENCH_ARMS'  # environment variable: the namespaces. What to make must be known before ROS has started


class _Namespaced(Node):
    """Comes between a node's class and rclpy's, and adds the namespace; `namespaced` makes such classes."""

    namespace = ''

    def __init__(self, name: str) -> None:
        super().__init__(name, namespace=self.namespace)


def namespaced(node: type[Node], namespace: str) -> type[Node]:
    """The same node in a namespace that the command line did not give, since that holds for a whole process."""
    return type(node.__name__, (node, _Namespaced), {'namespace': namespace})


class Conductor(Node):
    """Runs the loops of all robots, each in a thread; a process that runs nodes knows of one loop only."""

    def __init__(self, sims: list[MeasuredSim]) -> None:
        super().__init__('conductor')
        self._sims = sims

    def run(self, stopped: threading.Event, waiting: Waiting) -> None:
        """Until the event is set."""
        threads = [threading.Thread(target=sim.run, args=(stopped, waiting)) for sim in self._sims]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()


def _kept(sims: list[MeasuredSim], namespace: str) -> MeasuredSim:
    sims.append(namespaced(MeasuredSim, namespace)())
    return sims[-1]


def main() -> int:
    """Console entry point."""
    sims: list[MeasuredSim] = []
    makes = [partial(Conductor, sims)]
    for arm in os.environ[ARMS].split():
        makes += [partial(_kept, sims, arm), namespaced(ControllerNode, arm), namespaced(PlannerNode, arm)]
    return run_nodes(*makes)


if __name__ == '__main__':
    sys.exit(main())
