"""Node `planner`: streams the task velocities of a task, one cartesian_velocity for each
joint_states.
"""

import sys
import time
from dataclasses import dataclass

import numpy as np
from geometry_msgs.msg import PoseStamped, TwistStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, String
from std_srvs.srv import Trigger

from redres_ros.errors import RedresError, one_line
from redres_ros.laws import make_law
from redres_ros.nodes.conversions import JointMapper, from_pose
from redres_ros.nodes.diagnostics import (
    ERROR,
    OK,
    WARN,
    Diagnostics,
    Health,
    InputMonitor,
    Watchdog,
)
from redres_ros.nodes.lifecycle import LifeError, ManagedNode
from redres_ros.nodes.markers import Markers
from redres_ros.nodes.parameters import ListenerParameters, declare
from redres_ros.nodes.qos import LATCHED, NEWEST, PUBLISH, RECENT
from redres_ros.nodes.robot_parameters import declare_robot
from redres_ros.nodes.runtime import run_nodes
from redres_ros.nodes.session_topics import REASON
from redres_ros.nodes.task_topics import TaskTopics
from redres_ros.nodes.wire import JointSample, JointStateReader, TwistWriter
from redres_ros.parameter import param
from redres_ros.planning.planner import Planner
from redres_ros.planning.task_clock import TaskClock
from redres_ros.planning.task_executor import Step, TaskExecutor, TaskState, way_to
from redres_ros.planning.waypoints import load_task, task_for
from redres_ros.policy import Policy
from redres_ros.tasks import make_task

_ANY_LAW = Policy(make_law('minimum_velocity'))


@dataclass(frozen=True)
class PlannerParameters(ListenerParameters):
    """Parameters of the node beside those of the arm."""

    task: str = param(
        '', "name of a task in config/tasks, or a path ending in .yaml; empty: the arm's own"
    )
    autostart: bool = param(
        False, 'begin as soon as the robot takes commands instead of waiting for planner/start'
    )
    resume_within: float = param(
        2.0,
        'silence of joint_states after which a task under way goes on by itself; after a longer '
        'one, as of a driver that was started again, it is over, unless autostart is set [s]',
        0.0,
        1e6,
    )
    feedback_limit: float = param(0.2, 'largest speed that the feedback may add [m/s]', 0.001, 10.0)
    target_speed: float = param(0.2, 'largest speed on the way to a target_pose [m/s]', 1e-3, 10.0)
    headstart: float = param(
        0.15,
        'share of a cycle that is left to the controller before a task velocity is computed, where '
        'each has a process of its own; none in lock-step',
        0.0,
        0.5,
    )
    lockstep: bool = param(
        False, 'begin with the first state: the controller waits for each cartesian_velocity'
    )


class PlannerNode(ManagedNode):
    """Knows time only from the states and from what the controller carries out: when the robot's
    clock stands, or the arm is stopped, so does the task.
    """

    def __init__(self) -> None:
        super().__init__('planner')
        self._robot = declare_robot(self)
        self._settings = declare(self, PlannerParameters())
        self._model = self._robot.model
        name = self._settings.task
        self._task = load_task(name) if name else task_for(self._robot.arm, self._robot.name)
        self._frame = self._settings.base_frame or self._model.base_frame
        self._states = JointStateReader()
        self._twists = TwistWriter(self._frame)
        self._joints = JointMapper(self._model.joint_names, self.get_logger().info)
        T = 1.0 / self._settings.rate
        self._T = T
        task_clock = TaskClock(T, self._settings.lockstep)
        resume_within = None if self._settings.autostart else self._settings.resume_within
        self._run = TaskExecutor(
            T, self._make_planner, task_clock, self._robot.task_space, resume_within
        )
        self._first_task = make_task(self._robot.task_space)
        self._asked: np.ndarray | None = None  # dx of the newest step
        self._tip: tuple[np.ndarray, np.ndarray] | None = None  # at the newest state
        self._target: tuple[np.ndarray, np.ndarray] | None = None  # instead of the task
        self._stop_reason = ''
        self._create_interfaces()
        self._start_life()

    def _create_interfaces(self) -> None:
        self._twist_publisher = self.create_publisher(TwistStamped, 'cartesian_velocity', PUBLISH)
        self._topics = TaskTopics(self, self._frame, self._run)
        self._markers = Markers(self, self._frame, self._task.waypoints)
        self._refusals = InputMonitor(self)
        self._watchdog = Watchdog(self, 'joint_states', self._settings.state_timeout)
        self._diagnostics = Diagnostics(self, self._robot.name, self._health)
        self.create_subscription(JointState, 'joint_states', self._on_state, RECENT, raw=True)
        self.create_subscription(Float64, 'controller/task_scaling', self._on_scaling, NEWEST)
        self.create_subscription(String, REASON, self._on_stop_reason, LATCHED)
        self.create_subscription(PoseStamped, 'target_pose', self._on_target, PUBLISH)
        self.create_service(Trigger, 'planner/start', self._on_start)
        self.create_service(Trigger, 'planner/stop', self._on_stop)

    def _make_planner(self, x: np.ndarray, R: np.ndarray) -> Planner:
        task = self._task
        if self._target is not None:
            task = way_to(task, x, R, *self._target, self._settings.target_speed)
        return Planner(task, x, R, feedback_limit=self._settings.feedback_limit)

    def _on_state(self, message: JointState | bytes) -> None:
        if not self.configured:
            return
        try:
            sample = self._states.read(message)
            if not self._joints.concerns(sample):
                return
            self._watchdog.feed()
            self._enter_state(sample)
        except RedresError as error:
            self._refusals.refuse('joint_states', error)
            return
        self._refusals.accept('joint_states')
        self._topics.publish()

    def _enter_state(self, sample: JointSample) -> None:
        stamp = sample.stamp
        q = self._joints.positions(sample)
        x, R = self._model.tip(q)
        self._tip = (x, R)
        if self._markers.wants(stamp):
            self._markers.see(stamp, x, self._model.pose(q, self._model.elbow_frame)[0])
        unachieved = self._unachieved(q) if self._run.is_due else None
        asking = self._run.state in (TaskState.WAITING, TaskState.MOVING)
        step = self._run.enter_state(stamp, x, R, time.monotonic(), unachieved)
        if asking and self._run.state is TaskState.IDLE:
            self.get_logger().warning(
                'the robot was started again, or silent for more than '
                f'{self._settings.resume_within:g} s (resume_within): the task is over; '
                'planner/start begins it anew'
            )
        self._asked = None if step is None else step.dx
        if step is not None:
            self._publish(step, R)

    def _unachieved(self, q: np.ndarray) -> np.ndarray | None:
        """The part of the last dx that a singularity does not let through at q, as any law."""
        if self._asked is None:
            return None
        state = self._model.unchecked_state(q, np.zeros(self._model.n))
        return _ANY_LAW.answer(state, self._first_task, self._asked, self._T).unachieved

    def _publish(self, step: Step, R: np.ndarray) -> None:
        self._twist_publisher.publish(self._twists.written(step.stamp, step.dx))
        if step.reference is not None:
            self._topics.show(step.stamp, step.reference, R)

    def _on_target(self, message: PoseStamped) -> None:
        try:
            self._check_active()
            target = from_pose(message, (self._frame, ''))
            self._check_way(target)
        except RedresError as error:
            self._refusals.refuse('target_pose', error)
            return
        self._refusals.accept('target_pose')
        self._target = target
        self._run.begin_anew()
        self._topics.publish()

    def _check_active(self) -> None:
        if not self.active:
            raise LifeError(f'the planner is {self.life}; it moves the arm only while active')

    def _check_way(self, target: tuple[np.ndarray, np.ndarray]) -> None:
        """Raise RangeError for a target that is too far away; every state would be refused then."""
        if self._tip is not None:
            way_to(self._task, *self._tip, *target, self._settings.target_speed)

    def _on_scaling(self, message: Float64) -> None:
        self._run.set_scaling(message.data)

    def _on_stop_reason(self, message: String) -> None:
        stopped = one_line(message.data)
        if stopped and not self._stop_reason and self._run.state is TaskState.MOVING:
            self.get_logger().warning(f'the robot has stopped, the task waits: {stopped}')
        self._stop_reason = stopped

    def _on_start(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        task = self._settings.task or 'the task'
        response.success = False
        if not self.active:
            response.message = f'{task}: the planner is {self.life}'
            return response
        if self._stop_reason:
            response.message = (
                f'{task}: the robot has stopped: {self._stop_reason}; sim/reset lets it go on'
            )
            return response
        response.success = True
        if self._run.state is TaskState.MOVING:
            response.message = f'{task}: is under way already; planner/stop ends it'
        else:
            self._target = None
            self._run.start()
            response.message = f'{task}: begins as soon as the robot takes commands'
        self._topics.publish()
        return response

    def _on_stop(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        moved = self._run.state in (TaskState.WAITING, TaskState.MOVING)
        self._run.stop()
        self._topics.publish()
        response.success = True
        response.message = 'stopped' if moved else 'was not moving'
        return response

    def _begin(self) -> None:
        if self._settings.autostart:
            self._run.start()
        self._topics.publish()

    def _end(self) -> None:
        self._run.stop()
        self._topics.publish()

    def _forget(self) -> None:
        self._target = None
        self._tip = None

    def _health(self) -> Health:
        figures = {
            'task': self._settings.task or 'that of the arm',
            'state': self._run.state.value,
            'begun at [ns]': self._run.start_stamp,
            'messages refused': self._refusals.count,
        }
        if self._watchdog.silent:
            return Health(ERROR, 'no joint_states', figures)
        if not self.active:
            return Health(WARN, self.life, figures)
        if self._stop_reason:
            return Health(WARN, f'the robot has stopped: {self._stop_reason}', figures)
        if self._refusals.reasons:
            return Health(WARN, self._refusals.reasons, figures)
        return Health(OK, self._run.state.value, figures)


class LonePlannerNode(PlannerNode):
    """A planner that has its process for itself, and lets the controller answer first.

    Both would want a processor as soon as a state comes. What the planner says of this state acts
    in the next cycle, so there is time.
    """

    def _on_state(self, message: JointState | bytes) -> None:
        if not self._settings.lockstep:
            time.sleep(self._settings.headstart * self._T)
        super()._on_state(message)


def main(arguments: list[str] | None = None) -> int:
    """Console entry point."""
    return run_nodes(LonePlannerNode, arguments=arguments)


if __name__ == '__main__':
    sys.exit(main())
