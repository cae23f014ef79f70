"""The loop without ROS: planner, controller, and an arm, ideal as in the paper or another one."""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from redres_ros.command import Command
from redres_ros.errors import DivergedError
from redres_ros.planning.planner import Planner, TargetFollower, source_of
from redres_ros.planning.task_clock import PathSpeed
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.policy import SPEED_LIMIT
from redres_ros.preview import Preview
from redres_ros.robot_model import RobotModel, RobotState
from redres_ros.simulation.recording import MotionRecorder, Recording
from redres_ros.types import JointPositions, Seconds, TaskVelocity, finite_vector

_PREVIEWED = 0.1  # [s] for which a preview is used, as that of the planner node
PATIENCE = 3.0  # a task may take this many times its nominal duration


class Client(Protocol):
    """Computes a command for each state: a Controller, or one of second order."""

    model: RobotModel
    T: Seconds
    m: int  # rows of dx, 3 or 6

    @property
    def horizon(self) -> Seconds:
        """How long a path it wants to know ahead; 0 for none."""

    def update(
        self, q: JointPositions, dx: TaskVelocity, *, ahead: Preview | None = None
    ) -> Command:
        """The command at a tick. Raises DivergedError for a joint speed above SPEED_LIMIT."""


class IdealArm:
    """Follows every reference exactly: q_{k+1} = q_k + T dq_k; the base of arms that do not."""

    stop_reason = ''  # why it takes no commands any more; empty while it does

    def __init__(self, q: JointPositions) -> None:
        self.q = q  # measured

    def step(self, q_ref: JointPositions) -> None:
        """One cycle with the reference that was computed from `q`."""
        self.q = q_ref


def run(
    controller: Client,
    task: WaypointTask,
    *,
    source: Planner | TargetFollower | None = None,
    plant: IdealArm | None = None,
    lead: Seconds = 0.0,
    greedy: bool = True,
    progress: Callable[[float], None] | None = None,
) -> Recording:
    """The task from its start until the last point is reached, which adds no row.

    A loop that diverges, does not arrive in time, or is stopped by the arm is returned as far as it
    went, with finished False. Where limits allow only a fraction s of the task velocity, the task's
    time advances by s T: the path is kept, and takes longer. The recorded s is relative to the
    nominal task velocity.

    Args:
        controller: Responds to each state; with m = 6 the orientation is part of the task.
        source: Where the task velocity comes from, such as a TargetFollower with poses and their
            times in set_path(); None: as source_of().
        plant: The arm; None: an ideal one.
        lead: By how much the task's time is ahead of the loop's at the start.
        greedy: Ask for the nominal speed of the path in every tick, however little of it limits
            leave; False: brake the path as the planner node does (planning/task_clock.py).
        progress: Called with the fraction of the nominal duration that is over.
    """
    source = source or source_of(task, None, None)
    start = finite_vector(task.start, controller.model.n, 'start of the task')
    plant = plant or IdealArm(start)
    T = controller.T
    nominal = task.segments * task.segment_time  # [s]
    is_pose = controller.m == 6
    speed = PathSpeed()
    unachieved: TaskVelocity | None = None  # of the last task velocity
    rest = np.zeros(controller.model.n)
    previewed = max(round(_PREVIEWED / T), 1)  # cycles
    preview: Preview | None = None
    recorder = MotionRecorder(controller.model, T, is_pose)
    for k in range(int(PATIENCE * nominal / T) + 1):
        t = k * T
        state = RobotState(controller.model, plant.q, rest, rest)
        R = state.R if is_pose else None
        reference = source.reference(
            state.x, t + lead, R, unachieved=unachieved, rate=speed.fraction
        )
        if plant.stop_reason:
            return recorder.recording(f'stopped after {t:.3f} s: {plant.stop_reason}')
        if reference.finished:
            return recorder.recording(f'reached the last point after {t:.3f} s', finished=True)
        if controller.horizon:
            if k % previewed == 0:
                reach = controller.horizon + _PREVIEWED
                preview = source.preview(t + lead, reach, speed.fraction)
            elif preview is not None:
                preview = preview.after(T)
        try:
            command = controller.update(plant.q, reference.dx, ahead=preview)
        except DivergedError:
            return recorder.recording(
                f'diverged at {t:.3f} s: a joint speed above {SPEED_LIMIT:g} rad/s'
            )
        executed = speed.fraction * command.s  # of the nominal speed
        recorder.add(t, command, reference, executed)
        lead -= (1.0 - executed) * T
        if not greedy:
            speed.advance(command.s, T)
        unachieved = command.unachieved
        plant.step(command.q_ref)
        if progress and k % 100 == 0:
            progress(t / nominal)
    return recorder.recording(f'did not reach the last point within {PATIENCE * nominal:g} s')
