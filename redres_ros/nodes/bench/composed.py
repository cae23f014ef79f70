"""Executable `composed` as it is, but with a stopwatch."""

import sys

from redres_ros.nodes.bench.sim import MeasuredSim
from redres_ros.nodes.controller import ControllerNode
from redres_ros.nodes.planner import PlannerNode
from redres_ros.nodes.runtime import run_nodes

if __name__ == '__main__':
    sys.exit(run_nodes(MeasuredSim, ControllerNode, PlannerNode))
