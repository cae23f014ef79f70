"""The paper's ideal loop: planner, controller, and an ideal arm."""

from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

import numpy as np

from redres_ros.command import Command
from redres_ros.errors import DivergedError, RangeError
from redres_ros.planning.planner import Planner
from redres_ros.planning.task_clock import PathSpeed
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.policy import SPEED_LIMIT
from redres_ros.robot_model import RobotModel, RobotState
from redres_ros.simulation.recording import MotionRecorder, Recording

PATIENCE = 3.0  # a task may take this many times its nominal duration


class Client(Protocol):
    """Computes a command for each state: a Controller, or one of second order.

    Attributes:
        model: Model of the arm.
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

        Raises:
            DivergedError: A joint speed above SPEED_LIMIT.
        """


def run(
    controller: Client,
    task: WaypointTask,
    *,
    delay: int = 0,
    greedy: bool = True,
    progress: Callable[[float], None] | None = None,
) -> Recording:
    """The task from its start until the last point is reached, which adds no row.

    A loop that diverges or does not arrive in time is returned as far as it went, with finished
    False.

    Args:
        controller: Responds to each state; with m = 6 the orientation is part of the task.
        task: Start and points.
        delay: Ticks by which the arm uses a reference late; 0 is q_{k+1} = q_k + T dq_k, 1 is a
            robot that takes up at tick k + 1 what was computed from the state at tick k.
        greedy: Ask for the nominal speed of the path in every tick, however little of it limits
            leave; False: brake the path as the planner node does (planning/task_clock.py).
        progress: Called with the fraction of the nominal duration that is over.

    Raises:
        RangeError: A delay below zero.
    """
    if delay < 0:
        raise RangeError('delay', delay, 0, np.inf, 'ticks')
    T = controller.T
    nominal = task.segments * task.segment_time  # [s]
    loop = _Loop(controller, task, delay, greedy)
    for k in range(int(PATIENCE * nominal / T) + 1):
        t = k * T
        try:
            if loop.advance(t):
                return loop.recording(f'reached the last point after {t:.3f} s', finished=True)
        except DivergedError:
            return loop.recording(
                f'diverged at {t:.3f} s: a joint speed above {SPEED_LIMIT:g} rad/s'
            )
        if progress and k % 100 == 0:
            progress(t / nominal)
    return loop.recording(f'did not reach the last point within {PATIENCE * nominal:g} s')


class _Loop:
    """Planner, controller and an ideal arm with a delay of some ticks.

    Where limits allow only a fraction s of the task velocity, the planner's clock advances by s T:
    the path is kept, and takes longer. The recorded s is relative to the nominal task velocity.

    Args:
        controller: Responds to each state.
        task: Start and points.
        delay: Ticks by which the arm uses a reference late.
        greedy: See PathSpeed.
    """

    def __init__(self, controller: Client, task: WaypointTask, delay: int, greedy: bool) -> None:
        self._controller = controller
        self._planner = Planner(task)
        self._speed = PathSpeed(greedy=greedy)
        self._turns = controller.m == 6  # whether the orientation is part of the task
        self._q = task.start
        self._on_the_way = deque([task.start] * delay)  # references not yet taken up
        self._late = 0.0  # [s] by which the planner's clock is behind
        self._unachieved: np.ndarray | None = None  # of the last task velocity, (m,)
        self._rest = np.zeros(len(task.start))
        self._recorder = MotionRecorder(controller.model, controller.T, self._turns)

    def advance(self, t: float) -> bool:
        """One tick at the time t [s]. True, and nothing is done, once the last point is reached.

        Raises DivergedError.
        """
        state = RobotState(self._controller.model, self._q, self._rest, self._rest)
        reference = self._planner.reference(
            state.x,
            t - self._late,
            state.R if self._turns else None,
            unachieved=self._unachieved,
            rate=self._speed.fraction,
        )
        if reference.finished:
            return True
        command = self._controller.update(self._q, reference.dx)
        executed = self._speed.fraction * command.s  # of the nominal speed
        recorded = command
        if executed != command.s:
            recorded = replace(command, solution=replace(command.solution, s=executed))
        self._recorder.add(t, recorded, reference)
        self._late += (1.0 - executed) * self._controller.T
        self._speed.advance(command.s, self._controller.T)
        self._unachieved = command.unachieved
        self._on_the_way.append(command.q_ref)
        self._q = self._on_the_way.popleft()
        return False

    def recording(self, ending: str, *, finished: bool = False) -> Recording:
        """What was recorded so far.

        Args:
            ending: How the loop ended, in words.
            finished: Whether the last point was reached.
        """
        return self._recorder.recording(ending, finished=finished)
