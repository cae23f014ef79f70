"""MuJoCo's window beside a running graph: `redres demo --view window`."""

import os
import sys
import threading

from redres_ros.graph.graph_monitor import NICENESS, GraphMonitor
from redres_ros.graph.live_arm import LiveArm
from redres_ros.nodes.runtime import Waiting, run_nodes
from redres_ros.view.mujoco_window import opened

_PERIOD = 0.02  # [s] from one look at the arm to the next


class WindowNode(GraphMonitor):
    """Shows the arm of the graph in its domain and namespace."""

    def __init__(self) -> None:
        super().__init__('viewer')

    def run(self, stopped: threading.Event, waiting: Waiting) -> None:
        """Show the arm until the event is set or the window is closed.

        Args:
            stopped: Ends it.
            waiting: How to wait.

        Raises:
            CallError: There is no graph.
            WindowError: There is no display.
        """
        if not self.client.await_nodes(stopped, waiting):
            return
        arm = LiveArm(self, self.client.parameters('controller'))
        with opened(arm.model.arm) as window:
            while window.is_open and not stopped.is_set():
                arm.look()
                window.show(arm.q)
                waiting.sleep(_PERIOD)


def main(arguments: list[str] | None = None) -> int:
    """Console entry point."""
    os.nice(NICENESS)
    return run_nodes(WindowNode, arguments=arguments)


if __name__ == '__main__':
    sys.exit(main())
