"""The paper's ideal loop: planner, controller, and an arm that goes where it is told."""

from collections import deque
from collections.abc import Callable, Mapping
from typing import Protocol

import numpy as np

from redres_ros.controller import Command
from redres_ros.laws import Law
from redres_ros.planner import Planner
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.recording import Recording, row
from redres_ros.waypoints import Task

SPEED_LIMIT = 1e4  # [rad/s]; far beyond any arm: a loop that gets there has diverged
PATIENCE = 3.0  # a task may take this many times its nominal duration


class Client(Protocol):
    """What answers the robot's states: a Controller, or one of second order. T [s] is the robot's
    cycle.
    """

    model: RobotModel
    T: float

    def update(self, q: np.ndarray, dx: np.ndarray) -> Command: ...


def run(
    controller: Client,
    task: Task,
    *,
    delay: int = 0,
    switches: Mapping[int, Law] | None = None,
    progress: Callable[[float], None] | None = None,
) -> Recording:
    """The task from its start until the last point is reached, which gives no row of its own.

    delay: ticks by which the arm uses a reference late; 0 is q_{k+1} = q_k + T dq_k, 1 is a robot
    that takes up at tick k + 1 what was computed from the state at tick k. switches: tick -> law to
    go over to. progress is told the share of the nominal duration that is over. A loop that
    diverges or does not arrive in time is returned as far as it went, with finished False.
    """
    planner = Planner(task)
    q = task.start
    T = controller.T
    nominal = task.segments * task.segment_time
    on_the_way = deque([q] * delay)  # references not yet taken up
    rows: list[list[float]] = []
    for k in range(int(PATIENCE * nominal / T) + 1):
        t = k * T
        if switches and k in switches:
            controller.switch_law(switches[k])  # type: ignore[attr-defined]  # only a Controller has laws to switch
        reference = planner.reference(controller.model.tip(q)[0], t)
        if reference.finished:
            return Recording.of(rows, len(q), T, True, f'reached the last point after {t:.3f} s')
        command = controller.update(q, reference.dx)
        if np.abs(command.dq).max() > SPEED_LIMIT:
            ending = f'diverged at {t:.3f} s: a joint speed above {SPEED_LIMIT:g} rad/s'
            return Recording.of(rows, len(q), T, False, ending)
        rows.append(row(t, command, reference))
        on_the_way.append(command.q_ref)
        q = on_the_way.popleft()
        if progress and k % 100 == 0:
            progress(t / nominal)
    return Recording.of(
        rows, len(q), T, False, f'did not reach the last point within {PATIENCE * nominal:g} s'
    )
