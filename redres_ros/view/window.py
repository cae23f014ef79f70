"""MuJoCo's window beside a running graph: `redres demo --view window`."""

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import mujoco
import mujoco.viewer
import numpy as np

from redres_ros.errors import RedresError
from redres_ros.graph.graph_monitor import NICENESS, GraphMonitor
from redres_ros.graph.live_arm import LiveArm
from redres_ros.nodes.runtime import Waiting, run_nodes
from redres_ros.robots import Arm
from redres_ros.simulation.render import camera, scene

_PATIENCE = 5.0  # [s] for the window to close


class WindowError(RedresError):
    """No window, as on a machine without a display."""


class Window:
    """An open window.

    Args:
        model: Of MuJoCo.
        viewer: Of MuJoCo, open.
    """

    def __init__(self, model: mujoco.MjModel, viewer: mujoco.viewer.Handle) -> None:
        self._model = model
        self._viewer = viewer

    @property
    def is_open(self) -> bool:
        """Whether nobody has closed it."""
        return bool(self._viewer.is_running())

    def show(self, q: np.ndarray) -> None:
        """Move the arm to joint positions q (n,) [rad]."""
        with self._viewer.lock():
            self._viewer.d.qpos[:] = q
            mujoco.mj_forward(self._model, self._viewer.d)
        self._viewer.sync()


@contextmanager
def opened(arm: Arm) -> Iterator[Window]:
    """A window with an arm. Raises WindowError."""
    model = scene(arm.description(), arm.tip_frame)
    data = mujoco.MjData(model)
    threads = set(threading.enumerate())
    try:
        viewer = mujoco.viewer.launch_passive(model, data, show_left_ui=False, show_right_ui=False)
    except (RuntimeError, mujoco.FatalError) as error:
        raise WindowError(f'MuJoCo opens no window here: {error}') from None
    seen_from = camera()
    with viewer:
        viewer.cam.lookat[:] = seen_from.lookat
        viewer.cam.distance = seen_from.distance
        viewer.cam.azimuth = seen_from.azimuth
        viewer.cam.elevation = seen_from.elevation
        yield Window(model, viewer)
    # MuJoCo's thread must be done before the process is: it would take it down.
    for thread in set(threading.enumerate()) - threads:
        thread.join(_PATIENCE)


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
