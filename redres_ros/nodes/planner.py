"""Node `planner`: streams a task's velocities, one cartesian_velocity for each joint_states."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, TwistStamped
from nav_msgs.msg import Path
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Int32, String
from std_srvs.srv import Trigger

from redres_ros.errors import RedresError, one_line
from redres_ros.loop.cycle_counter import NANOSECONDS
from redres_ros.nodes import topics
from redres_ros.nodes.conversions import (
    JointMapper,
    from_path,
    from_pose,
    to_joint_state,
    to_nanoseconds,
    to_path,
    to_pose,
    to_time,
    to_twist,
)
from redres_ros.nodes.diagnostics import Diagnostics, Health
from redres_ros.nodes.lifecycle import ManagedNode
from redres_ros.nodes.markers import show_traces
from redres_ros.nodes.parameters import ListenerParameters, declare
from redres_ros.nodes.policy_parameters import END_OF_REACH
from redres_ros.nodes.robot_parameters import declare_robot
from redres_ros.nodes.topics import LATCHED, NEWEST, PUBLISH, LatchedWords, Telemetry
from redres_ros.parameter import param
from redres_ros.planning.goals import Goal, GoalError, Goals, GoalSettings
from redres_ros.planning.task_executor import UNDER_WAY, Step, TaskExecutor, TaskState
from redres_ros.planning.unachieved import UnachievedVelocity
from redres_ros.planning.waypoints import task_for
from redres_ros.robot_model import RobotModel
from redres_ros.types import JointPositions, Nanoseconds, Position, Rotation

_Begin = Callable[[], str]

_PREVIEWED = 10.2  # [s] that are published of the path to come: the longest horizon of a law
_PREVIEW_PERIOD = 0.1  # [s]
_TARGET_TIMEOUT = 1.0  # [s] largest age of a target_pose


@dataclass(frozen=True)
class _PlannerParameters(ListenerParameters):
    task: str = param(
        '', "name of a task in config/tasks, or a path ending in .yaml; empty: the arm's own"
    )
    lockstep: bool = param(
        False, 'begin with the first state: the controller waits for each cartesian_velocity'
    )


class PlannerNode(ManagedNode):
    """Takes its time from the states and the task scaling: it stands still when the robot does."""

    def __init__(self) -> None:
        super().__init__('planner')
        robot, arm = declare_robot(self, has_dynamics=False)
        settings = self._settings = declare(self, _PlannerParameters())
        self._model = RobotModel(arm)
        self._task = task_for(arm, robot, settings.task)
        goals = declare(self, GoalSettings())
        self._autostart = goals.autostart
        self._goals = Goals(self._model, self._task, goals, settings.task_space)
        self._frame = settings.base_frame or self._model.base_frame
        self._joints = JointMapper(self._model.joint_names, self.get_logger().info)
        self._T = 1.0 / settings.rate
        unachieved = UnachievedVelocity(self._model, settings.task_space, self._T, END_OF_REACH)
        self._run = TaskExecutor(self._T, settings.task_space, settings.lockstep, unachieved)
        self._q: JointPositions | None = None  # at the newest state
        self._logged = ''  # on the log, of what happened to the goal
        self._published_start = 0  # stamp at which a task began [ns]
        self._previewed: Nanoseconds = 0  # stamp of the last preview
        self._create_interfaces(robot)
        self._publish_state()
        self._start_life()

    def _create_interfaces(self, robot: str) -> None:
        self._twist_publisher = self.create_publisher(TwistStamped, 'cartesian_velocity', PUBLISH)
        self._joint_publisher = self.create_publisher(JointState, 'joint_velocity', PUBLISH)
        self._preview_publisher = self.create_publisher(Path, topics.PREVIEW, PUBLISH)
        self._words = LatchedWords(self, topics.TASK_STATE)
        self._begun_publisher = self.create_publisher(Time, topics.TASK_BEGUN, LATCHED)
        types = {
            'planner/desired_pose': PoseStamped,
            'planner/task_error': Float64,
            'planner/segment': Int32,
            topics.PROGRESS: Float64,
        }
        self._telemetry = Telemetry(self, types)
        show_traces(self, self._frame, self._task.waypoints, self._trace)
        rate = None if self._settings.lockstep else self._settings.rate
        self._diagnostics = Diagnostics(self, robot, self._health, rate)
        subscribe = self.create_subscription
        subscribe(JointState, 'joint_states', self._on_state, topics.RECENT)
        subscribe(Float64, 'controller/task_scaling', self._on_scaling, NEWEST)
        subscribe(String, topics.MODE, self._on_mode, LATCHED)
        subscribe(String, topics.ACTIVE_LIMITS, self._on_limits, NEWEST)
        subscribe(String, topics.REASON, self._on_stop_reason, LATCHED)
        subscribe(PoseStamped, 'target_pose', self._on_target, PUBLISH)
        subscribe(Path, 'target_path', self._on_path, PUBLISH)
        begins = {'planner/start': self._start_task, 'planner/home': self._go_home}
        for service, begin in begins.items():
            self.create_service(Trigger, service, partial(self._respond, service, begin))
        self.create_service(Trigger, 'planner/stop', self._on_stop)

    def _on_state(self, message: JointState) -> None:
        if self.life == 'unconfigured' or not self._joints.concerns(message):
            return
        self._diagnostics.feed()
        with self._diagnostics.judging('joint_states'):
            stamp = to_nanoseconds(message.header.stamp)
            q = self._joints.in_order(message, 'position')
            x, R = self._model.tip(q)
            self._q = q
            step = self._run.enter_state(stamp, q, x, R, time.monotonic())
            if step and step.dq is not None:
                self._joint_publisher.publish(to_joint_state(stamp, self._joints.names, q, step.dq))
            if step and step.dx is not None:
                self._twist_publisher.publish(to_twist(stamp, self._frame, step.dx))
            if step and self._telemetry.subscribed:
                self._publish_reference(stamp, step, R)
            # In lock-step a run must not depend on which message comes first.
            if step and step.dx is not None and not self._settings.lockstep:
                self._publish_preview(stamp)
        self._publish_state()

    def _publish_preview(self, stamp: Nanoseconds) -> None:
        """Now and then, after what the controller waits for."""
        if 0 <= stamp - self._previewed < _PREVIEW_PERIOD * NANOSECONDS:
            return
        if self._preview_publisher.get_subscription_count():
            self._previewed = stamp
            preview = self._run.preview(_PREVIEWED)
            if preview is not None:
                self._preview_publisher.publish(to_path(stamp, self._frame, preview))

    def _trace(self) -> tuple[Position, ...]:
        """Where tip and elbow are; empty before the first state."""
        if self._q is None:
            return ()
        model = self._model
        return model.tip(self._q)[0], model.position(self._q, model.elbow_frame)

    def _publish_reference(self, stamp: Nanoseconds, step: Step, R: Rotation) -> None:
        """For displays; a task of positions leaves the orientation R as it is."""
        publish = self._telemetry.publish
        publish('progress', lambda: self._run.progress)
        reference = step.reference
        if reference is None:
            return
        R_d = R if reference.R_d is None else reference.R_d
        publish('desired_pose', lambda: to_pose(stamp, self._frame, reference.x_d, R_d))
        publish('task_error', lambda: float(np.linalg.norm(reference.error)))
        publish('segment', lambda: reference.segment)

    def _publish_state(self) -> None:
        """Publish the goal's state and start, and log what keeps it from its end, if changed."""
        if self._run.start_stamp != self._published_start:
            self._published_start = self._run.start_stamp
            self._begun_publisher.publish(to_time(self._published_start))
        self._words.publish({topics.TASK_STATE: self._run.state.value})
        remark = self._run.remark
        if remark and remark != self._logged:
            self.get_logger().warning(remark)
        self._logged = remark

    def _on_scaling(self, message: Float64) -> None:
        self._run.clock.set_scaling(message.data)

    def _on_mode(self, message: String) -> None:
        self._run.mode = one_line(message.data)

    def _on_limits(self, message: String) -> None:
        if message.data:
            self._run.monitor.active_limits = partial(one_line, message.data)

    def _on_stop_reason(self, message: String) -> None:
        self._run.set_stop_reason(one_line(message.data))
        self._publish_state()

    def _on_target(self, message: PoseStamped) -> None:
        with self._diagnostics.judging('target_pose'):
            x, R = from_pose(message, (self._frame, ''))
            self._check_ready()
            self._measured()
            stamp = to_nanoseconds(message.header.stamp)
            _, problem = self._run.cycles.judge(stamp, time.time_ns(), _TARGET_TIMEOUT)
            if problem:
                raise GoalError(f'{problem} (a zero stamp means now)')
            self._begin_goal(self._goals.target(x, R))

    def _on_path(self, message: Path) -> None:
        with self._diagnostics.judging('target_path'):
            cycles = self._run.cycles
            message.header.stamp = to_time(cycles.newest)  # from where its times are counted
            self._check_ready()
            self._measured()
            path = from_path(message, (self._frame, ''), self._settings.task_space == 'pose')
            self._begin_goal(self._goals.path(path, cycles))

    def _on_stop(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        was_running = self._run.state in UNDER_WAY
        self._end()
        message = 'the arm comes to rest' if was_running else 'nothing is running'
        return Trigger.Response(success=True, message=message)

    def _respond(self, service: str, begin: _Begin, *_: object) -> Trigger.Response:
        """Report what will happen, or why nothing will."""
        task = self._settings.task or 'the task'
        try:
            self._check_ready()
            message = begin()
        except RedresError as error:
            self._diagnostics.refuse(service, error)
            return Trigger.Response(success=False, message=f'{task}: {error}')
        self._diagnostics.accept(service)
        return Trigger.Response(success=True, message=f'{task}: {message}')

    def _start_task(self) -> str:
        """Begin the task, with the first state if none has come yet; returns what will happen."""
        if running := self._run.running:
            if running.goes_on:
                return 'is running already; planner/stop ends it'
            raise GoalError('the tip is on its way to a pose; planner/stop ends that')
        self._begin_goal(self._goals.task())
        home = '' if self._q is None else self._announced_home(self._q)
        duration = self._task.segments * self._task.segment_time  # [s]
        return f'{home}begins as soon as the robot takes commands; takes {duration:.3g} s'

    def _go_home(self) -> str:
        """Move the joints to the start of the task; returns what will happen."""
        q = self._measured()
        if self._run.running:
            raise GoalError('the tip is on its way; planner/stop ends that')
        self._begin_goal(self._goals.home())
        return self._announced_home(q).removesuffix('; ') or 'the joints are at its start already'

    def _announced_home(self, q: JointPositions) -> str:
        """Describes the motion from q to the start of the task; empty at the start."""
        path = self._goals.path_home(q)
        return f'the joints go to its start in {path.duration:.3g} s; ' if path else ''

    def _measured(self) -> JointPositions:
        """Where the joints are. Raises GoalError before the first state."""
        if self._q is None:
            raise GoalError('no joint_states received yet; expected them before a goal')
        return self._q

    def _check_ready(self) -> None:
        if not self.active:
            remedy = 'start its process again' if self.life == 'finalized' else 'activate it first'
            raise GoalError(f'the planner is {self.life}; {remedy}')
        stopped = self._run.stop_reason
        if stopped:
            raise GoalError(f'the robot has stopped: {stopped}; call sim/reset to go on')
        # Before the first state it says no more, in lock-step before the first task velocity.
        is_known = self._q is not None and not self._settings.lockstep
        if is_known and self._run.mode == 'inactive':
            raise GoalError('the controller is inactive; activate it first')

    def _begin_goal(self, goal: Goal) -> None:
        if goal.redirect and self._run.state is TaskState.HOMING:
            raise GoalError('the joints are moving to the start; planner/stop ends that')
        self._run.begin(goal)
        self._publish_state()

    def _begin(self) -> None:
        if self._autostart:
            self._begin_goal(self._goals.task())

    def _end(self) -> None:
        self._run.stop()
        self._publish_state()

    def _forget(self) -> bool:
        self._q = None
        return True

    def _health(self) -> Health:
        if self._run.stop_reason and not self.count_publishers(topics.REASON):
            self._run.set_stop_reason('')  # of a robot that has gone
        values = {
            'task': self._settings.task or 'that of the arm',
            'state': self._run.state.value,
            'progress': self._run.progress,
            'begun at [ns]': self._run.start_stamp,
        }
        stopped = self._run.stop_reason and f'the robot has stopped: {self._run.stop_reason}'
        return Health(values, self._run.state.value, stopped or self._run.remark)
