"""The paper's ideal loop: planner, controller, and an arm that goes where it is told."""

from collections import deque
from collections.abc import Callable, Mapping
from typing import Protocol

import numpy as np

from redres_ros.command import Command
from redres_ros.controller import SPEED_LIMIT
from redres_ros.errors import DivergedError, RangeError
from redres_ros.laws import Law
from redres_ros.planner import Planner
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.recording import Recording, row
from redres_ros.waypoints import WaypointTask

PATIENCE = 3.0  # a task may take this many times its nominal duration


class Client(Protocol):
    """What answers the robot's states: a Controller, or one of second order.

    Attributes:
        model: Of the arm.
        T: The robot's cycle [s].
        m: Rows of dx, 3 or 6.
    """

    model: RobotModel
    T: float
    m: int

    def update(self, q: np.ndarray, dx: np.ndarray) -> Command:
        """The command at a tick.

        Args:
            q: Joint positions, (n,) [rad].
            dx: Task velocity, (m,).
        """


def run(
    controller: Client,
    task: WaypointTask,
    *,
    delay: int = 0,
    switches: Mapping[int, Law] | None = None,
    progress: Callable[[float], None] | None = None,
) -> Recording:
    """The task from its start until the last point is reached, which gives no row of its own.

    Where limits allow only the share s of the task velocity, the planner's clock goes on by s T:
    the path is kept, and time is stretched. A loop that diverges or does not arrive in time is
    returned as far as it went, with finished False.

    Args:
        controller: Answers each state; with m = 6 the orientation is part of the task.
        task: Start and points.
        delay: Ticks by which the arm uses a reference late; 0 is q_{k+1} = q_k + T dq_k, 1 is a
            robot that takes up at tick k + 1 what was computed from the state at tick k.
        switches: Tick -> law to go over to.
        progress: Is told the share of the nominal duration that is over.

    Raises:
        RangeError: A delay below zero.
    """
    if delay < 0:
        raise RangeError('delay', delay, 0, np.inf, 'ticks')
    planner = Planner(task)
    q = task.start
    T = controller.T
    n = len(q)
    has_orientation = controller.m == 6
    nominal = task.segments * task.segment_time
    on_the_way = deque([q] * delay)  # references not yet taken up
    rows: list[list[float]] = []
    late = 0.0  # [s] by which the planner's clock is behind
    lost = None
    for k in range(int(PATIENCE * nominal / T) + 1):
        t = k * T
        if switches and k in switches:
            controller.switch_law(switches[k])  # type: ignore[attr-defined]  # only a Controller has laws to switch
        x, R = controller.model.tip(q)
        reference = planner.reference(x, t - late, R if has_orientation else None, lost=lost)
        if reference.finished:
            ending = f'reached the last point after {t:.3f} s'
            return Recording.of(rows, n, T, True, ending, has_orientation)
        try:
            command = controller.update(q, reference.dx)
        except DivergedError:
            return _diverged(rows, n, T, t, has_orientation)
        if np.abs(command.dq).max() > SPEED_LIMIT:
            return _diverged(rows, n, T, t, has_orientation)
        rows.append(row(t, command, reference))
        late += (1.0 - command.s) * T
        lost = command.lost
        on_the_way.append(command.q_ref)
        q = on_the_way.popleft()
        if progress and k % 100 == 0:
            progress(t / nominal)
    ending = f'did not reach the last point within {PATIENCE * nominal:g} s'
    return Recording.of(rows, n, T, False, ending, has_orientation)


def _diverged(
    rows: list[list[float]], n: int, T: float, t: float, has_orientation: bool
) -> Recording:
    ending = f'diverged at {t:.3f} s: a joint speed above {SPEED_LIMIT:g} rad/s'
    return Recording.of(rows, n, T, False, ending, has_orientation)
