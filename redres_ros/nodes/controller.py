"""Node `controller`: one joint_states message in, one joint_command out."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Path
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool

from redres_ros.command import ROBOT_INTERFACES
from redres_ros.contact import AdmittanceSettings, ContactControl
from redres_ros.controller import INTEGRATE_FROM, Controller
from redres_ros.errors import RedresError
from redres_ros.files.plugins import load_plugin
from redres_ros.laws import law_name
from redres_ros.loop.command_loop import CommandLoop, Response
from redres_ros.loop.modes import MOVING_MODES, Mode
from redres_ros.loop.velocity_input import LoopSettings
from redres_ros.nodes import topics
from redres_ros.nodes.controller_interfaces import ADMITTANCE, Forwarding, Sensors
from redres_ros.nodes.controller_telemetry import MotionTelemetry
from redres_ros.nodes.conversions import (
    JointMapper,
    deserialised,
    from_path,
    stacked,
    to_joint_state,
    to_nanoseconds,
)
from redres_ros.nodes.diagnostics import Diagnostics, Health
from redres_ros.nodes.lifecycle import ManagedNode
from redres_ros.nodes.markers import show_obstacles
from redres_ros.nodes.parameters import (
    NONE,
    ListenerParameters,
    declare,
    named,
    on_live_change,
    with_changes,
)
from redres_ros.nodes.policy_parameters import PolicyParameters
from redres_ros.nodes.robot_parameters import declare_robot
from redres_ros.nodes.topics import LatchedWords
from redres_ros.parameter import param
from redres_ros.robot_model import RobotModel
from redres_ros.types import check_finite

_Enter = Callable[[Any], Response | None]

_LOOK = 0.01  # [s] between looks at whether a state has waited long enough
_LARGEST_PREVIEW = 20_000  # bytes, some 250 poses: reading more takes several cycles
_REPEAT = 5.0  # [s] after which a warning is logged again


@dataclass(frozen=True)
class _ControllerParameters(ListenerParameters):
    """The node's own parameters; those of arm, motion and timing are declared with these."""

    switch_time: float = param(
        0.2,
        'time over which a change of law, starting and stopping are blended [s]',
        0.0,
        10.0,
        live=True,
    )
    integrate_from: str = param(
        'command', 'what a reference is integrated from', choices=INTEGRATE_FROM
    )
    plugins: tuple[str, ...] = param(
        (NONE,), 'Python files with laws, preferences, tasks and limits of your own'
    )
    robot_interface: str = param(
        'fri',
        'what the robot does without a command, and where commands go; fri and sim continue at the '
        'last velocity, and the clock of sim waits; fci continues at the last acceleration; '
        'ros2_control holds, and gets forward_position_controller/commands',
        choices=tuple(ROBOT_INTERFACES),
    )


class ControllerNode(ManagedNode):
    """Publishes a command for each state, in the callback that brings it; has no clock of its own.

    Deactivated it brings the arm to rest, and then publishes nothing any more.
    """

    def __init__(self) -> None:
        super().__init__('controller')
        robot, arm = declare_robot(self)
        settings = declare(self, _ControllerParameters())
        for plugin in named(settings.plugins):
            load_plugin(plugin)
        model = RobotModel(arm)
        T = 1.0 / settings.rate
        self._policy = PolicyParameters(self, model, settings.task_space, T)
        loop_settings = declare(self, LoopSettings())
        self._controller = Controller(
            model,
            self._policy.policy.law,
            T,
            switch_time=settings.switch_time,
            integrate_from=settings.integrate_from,
            robot_interface=settings.robot_interface,
        )
        self._controller.set_policy(self._policy.policy)
        self._rows = self._controller.m
        admittance = declare(self, AdmittanceSettings.of_rows(self._rows), ADMITTANCE)
        contact = ContactControl(admittance, T, switch_time=settings.switch_time)
        self._loop = CommandLoop(self._controller, loop_settings, contact)
        self._loop.deactivate()
        frame = settings.base_frame or model.base_frame
        self._base_frames = ('', frame, model.base_frame)
        self._joints = JointMapper(model.joint_names, self.get_logger().info)
        self._command_publisher = self.create_publisher(JointState, 'joint_command', topics.PUBLISH)
        self._forwarding: Forwarding | None = None
        if self._controller.robot_interface.forwards_commands:
            self._forwarding = Forwarding(self, model.joint_names)
        self._words = LatchedWords(self, topics.MODE)
        self._reported_error = ''
        self._session: String | None = None  # of the robot, to be entered at rest
        self._telemetry = MotionTelemetry(self, frame, T)
        rate = None if loop_settings.lockstep else settings.rate
        self._diagnostics = Diagnostics(self, robot, self._health, rate)
        self._sensors = Sensors(self, self._controller, self._loop, self._diagnostics)
        show_obstacles(self, frame)
        self._listen()
        on_live_change(self, self._check, self._apply)
        self._start_life()
        self._report()

    def _listen(self) -> None:
        self._states = self.create_subscription(
            JointState, 'joint_states', self._on_state, topics.NEWEST
        )
        self._take('cartesian_velocity', TwistStamped, self._enter_twist)
        self._take('joint_velocity', JointState, self._enter_joint_velocity)
        self.create_subscription(Path, topics.PREVIEW, self._on_preview, topics.NEWEST, raw=True)
        self.create_subscription(String, topics.SESSION, self._on_session, topics.LATCHED)
        self.create_service(SetBool, 'controller/hold', self._on_hold)
        self._sensors.apply({})
        if self._controller.robot_interface.patience:
            self.create_timer(_LOOK, self._respond_if_due, clock=topics.STEADY)

    def _take(self, topic: str, kind: type, enter: _Enter) -> None:
        self.create_subscription(kind, topic, partial(self._respond, topic, enter), topics.RECENT)

    def _on_state(self, message: JointState) -> None:
        if self._joints.concerns(message):
            if self._sensors.from_effort:
                self._sensors.enter_effort(message)
            self._respond('joint_states', self._enter_state, message)
            self._diagnostics.feed()
        elif self._states.qos_profile == topics.NEWEST:
            # DDS keeps the newest one of all publishers: another's would displace the arm's.
            newest = self._states
            self._states = self.create_subscription(
                JointState, 'joint_states', self._on_state, topics.SHARED
            )
            self.destroy_subscription(newest)

    def _enter_state(self, message: JointState) -> Response | None:
        q = self._joints.in_order(message, 'position')
        is_connected = self._forwarding is None or not self._forwarding.is_pending
        stamp = to_nanoseconds(message.header.stamp)
        return self._loop.step(stamp, q, time.monotonic(), is_connected=is_connected)

    def _enter_twist(self, message: TwistStamped) -> Response | None:
        stamp = to_nanoseconds(message.header.stamp)
        dx = stacked(message.twist.linear, message.twist.angular)
        check_finite(dx, 'cartesian_velocity')
        frame = message.header.frame_id
        if self._loop.q is not None and frame not in self._base_frames:
            _, R = self._controller.model.pose(self._loop.q, frame)
            dx = np.concatenate((R.dot(dx[:3]), R.dot(dx[3:])))
        return self._loop.enter_velocity(stamp, dx[: self._rows], time.monotonic(), time.time_ns())

    def _enter_joint_velocity(self, message: JointState) -> Response | None:
        dq = self._joints.in_order(message, 'velocity')
        stamp = to_nanoseconds(message.header.stamp)
        now = time.monotonic()
        return self._loop.enter_velocity(stamp, dq, now, time.time_ns(), of_joints=True)

    def _on_preview(self, data: bytes) -> None:
        with self._diagnostics.judging(topics.PREVIEW):
            if len(data) > _LARGEST_PREVIEW:
                raise RedresError(f'{len(data)} bytes; allowed: {_LARGEST_PREVIEW}')
            message = deserialised(data, Path)
            preview = from_path(message, self._base_frames, self._rows > 3)
            self._loop.preview = to_nanoseconds(message.header.stamp), preview

    def _respond_if_due(self) -> None:
        self._respond('joint_states', self._loop.respond_if_due, time.monotonic())

    def _respond(self, source: str, enter: _Enter, given: Any) -> None:
        """Publish the response to what was given, or report why it was refused."""
        if self.life == 'unconfigured':
            return
        with self._diagnostics.judging(source):
            response = enter(given)
            # A new mode goes out before its first command.
            if self._loop.mode.value != self._words.published.get(topics.MODE):
                self._report()
            if response is not None:
                self._publish(response)
            if self._loop.warning:
                self._report()

    def _publish(self, response: Response) -> None:
        # The planner is to know of another scaling before the state after this one.
        self._telemetry.publish_change(response.scaling)
        command = response.command
        message = to_joint_state(response.stamp, self._joints.names, command.q_ref, command.dq)
        self._command_publisher.publish(message)
        if self._forwarding:
            self._forwarding.publish(command.q_ref)
        self._loop.sent = time.monotonic()
        self._telemetry.publish(response, self._controller.policy)

    def _report(self) -> None:
        """Publish a new mode, and log its reason."""
        loop = self._loop
        if loop.warning:
            self.get_logger().error(loop.warning, throttle_duration_sec=_REPEAT)
        error = self._error
        if error and error != self._reported_error:
            self.get_logger().error(error)
        self._reported_error = error
        self._words.publish({topics.MODE: loop.mode.value})

    @property
    def _error(self) -> str:
        """What blocks motion; empty if nothing does."""
        return (self._forwarding.error if self._forwarding else '') or self._loop.error

    def _on_session(self, message: String) -> None:
        """Another robot that joins must not make an arm in motion mirror; it stops first."""
        moves = self._loop.mode in MOVING_MODES and not self._diagnostics.was_silent
        is_of_another = moves and self.count_publishers(topics.SESSION) > 1
        self._session = message if is_of_another else None
        if is_of_another:
            self._loop.faults.set(f'two nodes publish {topics.SESSION}; only one may')
        else:
            self._loop.enter_session(message.data)

    def _on_hold(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._loop.hold(request.data)
        message = self._loop.error or 'following task velocities'
        if request.data:
            message = 'holding'
        elif not self.active:
            message = f'the controller is {self.life}; it moves the arm only while active'
        return SetBool.Response(success=request.data or self.active, message=message)

    def _begin(self) -> None:
        self._loop.activate()

    def _end(self) -> None:
        self._loop.deactivate()
        self._report()

    def _forget(self) -> bool:
        if self._loop.mode in MOVING_MODES and not self._diagnostics.silent:
            return False
        self._loop.forget()
        return True

    def _check(self, changes: dict[str, Any]) -> None:
        self._policy.check(changes)
        with_changes(self._loop.input.settings, changes)
        self._sensors.check(changes)

    def _apply(self, changes: dict[str, Any]) -> None:
        before = self._policy.policy
        policy = self._policy.adopt()
        if policy != before:
            self._controller.set_policy(policy)
        if 'switch_time' in changes:
            self._controller.switch_time = changes['switch_time']
            self._loop.measurements.contact.switch_time = changes['switch_time']
        self._sensors.apply(changes)
        self._loop.input.settings = with_changes(self._loop.input.settings, changes)

    def _health(self) -> Health:
        law = self._controller.law
        loop = self._loop
        if self._session and loop.mode not in MOVING_MODES:
            self._on_session(self._session)
        values = {
            'mode': loop.mode.value,
            'law': law_name(law),
            'damping [1/s]': law.damping,
            'forgetting factor': law.forgetting_factor(self._controller.T),
            'commands published': loop.responses,
            'states skipped': loop.skipped,
            'task velocities missing': loop.input.of_task.missing,
            'task velocities late': loop.input.of_task.late,
            'references changed by the safety filter': loop.safety_filter.count,
        }
        contact = loop.measurements.contact
        if contact.is_on:
            force = ', '.join(f'{value:.3g}' for value in contact.force)
            values['force on the tip [N]'] = force
        error = self._error
        if error:
            self._report()
        warning = loop.warning or self._policy.problem
        if loop.mode is Mode.MIRRORING:
            warning = 'mirroring: the robot takes no commands'
        return Health(values, loop.mode.value, warning, error)
