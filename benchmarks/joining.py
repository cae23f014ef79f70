"""What a participant that joins the graph costs: cycles that the fake robot waits for.

    python benchmarks/joining.py [--minutes 10]

The three nodes run at 500 Hz in a domain of their own. Windows of ten seconds take turns: nobody
joins; a process starts every second, and joins another domain; it joins the nodes' domain, as each
call of `ros2 param get` does. The second kind shows the cost of such a process by itself.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node

from redres_ros.demo.processes import NodeProcess
from redres_ros.nodes.discovery import own_domain
from redres_ros.nodes.runtime import spun

WINDOW = 10.0  # [s]
START = 20.0  # [s] until all have found each other
JOIN = "import rclpy; rclpy.init(); n = rclpy.create_node('joining'); n.get_node_names()"
PARAMETERS: dict[str, dict[str, Any]] = {
    'sim': {'patience': 1.0},
    'controller': {},
    'planner': {'task': 'side_to_side', 'autostart': True},
}


class Counter(Node):
    """The newest counts of the fake robot: all cycles, and those waited for."""

    def __init__(self) -> None:
        super().__init__('counter')
        self.counts = (0, 0)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_health, 10)

    def _on_health(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == '/sim':
                values = {pair.key: pair.value for pair in status.values}
                self.counts = (int(values['cycles']), int(values['cycles waited for']))


def window(counter: Counter, domain: int | None) -> tuple[int, int]:
    """Cycles in a window, and those waited for.

    Args:
        counter: Observes the robot.
        domain: Which a process joins every second; None: there is no process.
    """
    before = counter.counts
    until = time.monotonic() + WINDOW
    while time.monotonic() < until:
        if domain is not None:
            environment = {**os.environ, 'ROS_DOMAIN_ID': str(domain)}
            subprocess.run([sys.executable, '-c', JOIN], env=environment, check=True)
        time.sleep(1.0)
    after = counter.counts
    return after[0] - before[0], after[1] - before[1]


def main() -> None:
    """Print a row for each kind of window."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--minutes', type=float, default=10.0)
    minutes = parser.parse_args().minutes
    with own_domain() as other, own_domain() as domain, ExitStack() as stack:
        kinds = {'nobody joins': None, 'a process elsewhere': other, 'a process joins': domain}
        counts = {kind: [0, 0] for kind in kinds}
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        for name, parameters in PARAMETERS.items():
            process = NodeProcess(name, folder / f'{name}.log', parameters)
            stack.callback(process.end)
        counter = stack.enter_context(spun(Counter))
        time.sleep(START)
        until = time.monotonic() + 60.0 * minutes
        while time.monotonic() < until:
            for kind, joined in kinds.items():
                cycles, waited = window(counter, joined)
                counts[kind][0] += cycles
                counts[kind][1] += waited
    print('| every second | cycles | waited for, of 1000 |\n|---|---|---|')
    for kind, (cycles, waited) in counts.items():
        print(f'| {kind} | {cycles} | {1000.0 * waited / max(cycles, 1):.1f} |')


if __name__ == '__main__':
    main()
