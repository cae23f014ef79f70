"""Node `controller`: one joint_states message in, one joint_command out."""

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any

from geometry_msgs.msg import TwistStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool

from redres_ros.controller import INTEGRATE_FROM, Controller
from redres_ros.errors import RedresError, one_line
from redres_ros.files.plugins import load_plugins
from redres_ros.laws import law_name
from redres_ros.loop.command_loop import CommandLoop, Response
from redres_ros.loop.settings import LoopSettings, why_it_would_leap
from redres_ros.loop.twist_buffer import TwistBufferSettings
from redres_ros.nodes.command_publisher import CommandPublisher
from redres_ros.nodes.conversions import JointMapper, TwistTransformer
from redres_ros.nodes.diagnostics import (
    ERROR,
    OK,
    WARN,
    Diagnostics,
    Health,
    InputMonitor,
    Watchdog,
)
from redres_ros.nodes.lifecycle import ManagedNode
from redres_ros.nodes.markers import show_obstacles
from redres_ros.nodes.motion_parameters import NONE, MotionParameters, named
from redres_ros.nodes.motion_telemetry import MotionTelemetry
from redres_ros.nodes.parameters import ListenerParameters, declare, on_live_change
from redres_ros.nodes.qos import LATCHED, NEWEST, RECENT
from redres_ros.nodes.robot_parameters import declare_robot
from redres_ros.nodes.runtime import run_nodes
from redres_ros.nodes.wire import JointSample, JointStateReader, read_twist
from redres_ros.parameter import param
from redres_ros.vectors import check_finite

_LOOK = 0.01  # [s] between looks at whether a state has waited long enough
_TELL_AGAIN = 5.0  # [s] after which a restart is told again


@dataclass(frozen=True)
class ControllerParameters(ListenerParameters):
    """The node's own parameters; those of arm, motion and timing are declared with these."""

    switch_time: float = param(
        0.2,
        'time over which a change of law, starting and stopping are blended [s]',
        0.0,
        10.0,
        live=True,
    )
    task_scaling_rate: float = param(
        0.0,
        'rate at which the share of the task velocity rises again after limits have lowered it; '
        '0: the largest share in every tick [1/s]',
        0.0,
        1000.0,
        live=True,
    )
    integrate_from: str = param(
        'command', 'what a reference is integrated from', choices=INTEGRATE_FROM
    )
    plugins: tuple[str, ...] = param(
        (NONE,), 'Python files with laws, preferences, tasks and limits of your own'
    )
    forward_commands: bool = param(False, 'also publish forward_position_controller/commands')


class ControllerNode(ManagedNode):
    """Answers each state of the robot in the callback that brings it; has no clock of its own.

    Deactivated it brings the arm to rest, and then answers no more.
    """

    def __init__(self) -> None:
        super().__init__('controller')
        robot = declare_robot(self)
        settings = declare(self, ControllerParameters())
        load_plugins(named(settings.plugins))
        model = robot.model
        T = 1.0 / settings.rate
        self._motion = MotionParameters(self, model, T)
        wanted = self._motion.wanted({})
        self._controller = Controller(
            model,
            wanted.law,
            T,
            task=robot.task_space,
            switch_time=settings.switch_time,
            integrate_from=settings.integrate_from,
            task_scaling_rate=settings.task_scaling_rate,
            limits=wanted.limits,
            preferences=wanted.preferences,
            secondary_tasks=wanted.secondary_tasks,
        )
        following = declare(self, LoopSettings())
        self._loop = CommandLoop(self._controller, following, declare(self, TwistBufferSettings()))
        if leap := why_it_would_leap(settings.forward_commands, following.bridging):
            self.get_logger().warning(leap)
        frame = settings.base_frame or model.base_frame
        self._axes = TwistTransformer(model, frame)
        self._states = JointStateReader()
        self._joints = JointMapper(model.joint_names, self.get_logger().info)
        self._commands = CommandPublisher(self, model.joint_names, settings.forward_commands)
        self._telemetry = MotionTelemetry(self, frame, T)
        self._refusals = InputMonitor(self)
        self._watchdog = Watchdog(self, 'joint_states', settings.state_timeout)
        self._diagnostics = Diagnostics(self, robot.name, self._health)
        self._hold_wanted = False  # by the service
        show_obstacles(self, frame)
        self._listen()
        on_live_change(self, self._check, self._apply)
        self._start_life()

    def _listen(self) -> None:
        self.create_subscription(JointState, 'joint_states', self._on_state, NEWEST, raw=True)
        self.create_subscription(
            TwistStamped, 'cartesian_velocity', self._on_twist, RECENT, raw=True
        )
        self.create_subscription(String, 'sim/session_state', self._on_session, LATCHED)
        self.create_service(SetBool, 'controller/hold', self._on_hold)
        if self._loop.settings.twist_patience:
            self.create_timer(_LOOK, self._on_look)

    def _on_state(self, message: JointState | bytes) -> None:
        try:
            sample = self._states.read(message)
        except RedresError as error:
            self._refusals.refuse('joint_states', error)
            return
        if self._joints.concerns(sample):
            self._watchdog.feed()
            self._answer('joint_states', self._enter_state, sample)

    def _enter_state(self, sample: JointSample) -> Response | None:
        q = self._joints.positions(sample)
        return self._loop.enter_state(sample.stamp, q, time.monotonic())

    def _on_twist(self, message: TwistStamped | bytes) -> None:
        self._answer('cartesian_velocity', self._enter_twist, message)

    def _enter_twist(self, message: TwistStamped | bytes) -> Response | None:
        stamp, frame, dx = read_twist(message)
        check_finite(dx, 'cartesian_velocity')
        if self._loop.q is not None:
            dx = self._axes.to_base(dx, frame, self._loop.q)
        return self._loop.enter_twist(stamp, dx[: self._controller.m], time.monotonic())

    def _on_look(self) -> None:
        self._answer('joint_states', self._loop.answer_if_due, time.monotonic())

    def _answer(self, source: str, enter: Callable[[Any], Response | None], given: Any) -> None:
        """Publish what is answered to what was given, or tell why it was refused."""
        if not self.configured:
            return
        try:
            answer = enter(given)
        except RedresError as error:
            self._refusals.refuse(source, error)
            return
        self._refusals.accept(source)
        if answer is not None and (self.active or answer.command.dq.any()):
            self._publish(answer)

    def _publish(self, answer: Response) -> None:
        # The planner is to know of another scaling before the state after this one.
        self._telemetry.publish_change(answer.scaling)
        self._commands.publish(answer.stamp, answer.command)
        self._loop.note_sent(time.monotonic())
        self._telemetry.publish(answer, self._controller.law)
        if answer.restarted:
            self.get_logger().warning(
                f'starting anew {answer.restarted}',
                throttle_duration_sec=_TELL_AGAIN,
            )

    def _on_session(self, message: String) -> None:
        before = self._loop.commanding
        self._loop.enter_session(message.data)
        if before and not self._loop.commanding and self._loop.answered:
            word = one_line(message.data)
            self.get_logger().warning(f'the robot takes no commands: its session is {word}')
        elif not before and self._loop.commanding:
            self.get_logger().info('the robot takes commands')

    def _on_hold(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._hold_wanted = request.data
        self._loop.held = request.data or not self.active
        response.success = True
        response.message = 'holding' if request.data else 'following cartesian_velocity'
        return response

    def _begin(self) -> None:
        self._controller.reset()  # the arm may have been moved by others
        self._loop.held = self._hold_wanted

    def _end(self) -> None:
        self._loop.held = True  # softly to rest

    def _forget(self) -> None:
        self._loop.forget()
        self._hold_wanted = False

    def _check(self, changes: dict[str, Any]) -> None:
        self._motion.wanted(changes).law.check_damping(self._controller.T)

    def _apply(self, changes: dict[str, Any]) -> None:
        self._motion.apply(changes, self._controller)
        if 'switch_time' in changes:
            self._controller.switch_time = changes['switch_time']
        if 'task_scaling_rate' in changes:
            self._controller.task_scaling_rate = changes['task_scaling_rate']
        self._loop.settings = _changed(self._loop.settings, changes)

    def _health(self) -> Health:
        law = self._controller.law
        following = self._loop
        figures = {
            'law': law_name(law),
            'damping [1/s]': law.damping,
            'forgetting factor': law.forgetting_factor(self._controller.T),
            'states answered': following.answered,
            'states skipped': following.skipped,
            'task velocities missing': following.twist_buffer.missing,
            'task velocities late': following.twist_buffer.late,
            'messages refused': self._refusals.count,
        }
        if self._watchdog.silent:
            return Health(ERROR, 'no joint_states', figures)
        if self._refusals.reasons:
            return Health(WARN, self._refusals.reasons, figures)
        if not self.active:
            return Health(WARN, self.life, figures)
        if not following.commanding:
            return Health(WARN, 'mirroring: the robot takes no commands', figures)
        if following.limit_warning:
            return Health(WARN, following.limit_warning, figures)
        return Health(OK, 'holding' if following.held else 'commanding', figures)


def _changed(settings: Any, changes: dict[str, Any]) -> Any:
    """A dataclass with those of the changes that are fields of it."""
    names = {field.name for field in fields(settings)}
    return replace(settings, **{name: changes[name] for name in names & changes.keys()})


def main(arguments: list[str] | None = None) -> int:
    """Console entry point."""
    return run_nodes(ControllerNode, arguments=arguments)


if __name__ == '__main__':
    sys.exit(main())
