"""Executable `composed` as it is, but with a stopwatch."""

import sys

from redres_ros.bench.sim import MeasuredSim
from redres_ros.nodes.composed import run_composed

if __name__ == '__main__':
    sys.exit(run_composed(MeasuredSim))
