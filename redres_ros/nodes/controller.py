"""Node `controller`: one joint_states message in, one joint_command out."""

import sys
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from geometry_msgs.msg import PoseStamped, TwistStamped
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray, String
from std_srvs.srv import SetBool

from redres_ros.controller import INTEGRATE_FROM, Command, Controller
from redres_ros.errors import RedresError
from redres_ros.laws import law_name
from redres_ros.nodes.conversions import (
    NANOSECONDS,
    JointMessage,
    JointOrder,
    from_twist,
    to_nanoseconds,
    to_pose,
)
from redres_ros.nodes.diagnostics import ERROR, OK, WARN, Diagnostics, Health, Refusals, Watchdog
from redres_ros.nodes.parameters import LawParameters, declare, declare_robot, on_live_change
from redres_ros.nodes.qos import LATCHED, NEWEST, PUBLISH
from redres_ros.nodes.runtime import run_nodes
from redres_ros.nodes.telemetry import Telemetry
from redres_ros.parameter import param

COMMANDING = (
    'CMD',
    'COMMANDING_ACTIVE',
)  # session states of the two profiles in which the robot takes commands

_NEW_CLOCK = NANOSECONDS  # a step of the stamps by more than this is a robot that was started again
# for such a robot to tell its session: DDS may take 3 s to bring a latched word
_SESSION_PATIENCE = 5 * NANOSECONDS


@dataclass(frozen=True)
class ControllerParameters:
    """Parameters of the node beside those of the arm and the law."""

    rate: float = param(500.0, 'cycles per second, the rate of joint_states [Hz]', 10.0, 2000.0)
    base_frame: str = param(
        '', "frame of cartesian_velocity; empty: the root link of the arm's URDF"
    )
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
    command_timeout: float = param(
        0.1, 'age at which cartesian_velocity is stale [s]', 0.001, 10.0, live=True
    )
    state_timeout: float = param(0.1, 'silence of joint_states that is reported [s]', 0.01, 10.0)
    bridged_misses: int = param(
        5,
        'cycles without a state after which the controller starts anew from the measurement',
        0,
        1000,
    )
    following_tolerance: float = param(
        0.1,
        'lag of a joint at which the arm counts as stopped, and the controller '
        'starts anew from the measurement [rad]',
        0.001,
        10.0,
    )
    forward_commands: bool = param(False, 'also publish forward_position_controller/commands')
    lockstep: bool = param(
        False, 'answer a state only together with the cartesian_velocity of the same stamp'
    )


class StampError(RedresError):
    """A state whose stamp does not follow from the last one."""


class _Twist(NamedTuple):
    """A task velocity and its stamp [ns] on the robot's clock; stamp 0: none has come yet."""

    stamp: int
    dx: np.ndarray


class ControllerNode(Node):
    """Answers each state of the robot in the callback that brings it; it has no clock of its own."""

    def __init__(self) -> None:
        super().__init__('controller')
        self._robot = declare_robot(self)
        self._settings = declare(self, ControllerParameters())
        self._law_parameters = LawParameters(self)
        model = self._robot.model
        rate = self._settings.rate
        self._controller = Controller(
            model,
            self._law_parameters.law,
            1.0 / rate,
            task=self._robot.task_space,
            switch_time=self._settings.switch_time,
            integrate_from=self._settings.integrate_from,
        )
        self._frame = self._settings.base_frame or model.base_frame
        self._joints = JointOrder(model.joint_names)
        self._period = round(NANOSECONDS / rate)
        self._held = self._has_commanded = False
        self._commanding = True  # a robot without a session always lets itself be commanded
        self._has_session = False
        self._silent_until = 0  # stamp [ns] until which a new robot may tell of its session
        self._twist = _Twist(0, np.zeros(self._controller.m))
        self._stamp = 0
        self._answer = JointMessage(model.joint_names)  # of the state answered last, and the answer
        self._waiting: JointState | None = None  # for its cartesian_velocity, in lock-step
        self._answered = self._skipped = 0
        self._create_interfaces()
        on_live_change(self, self._check, self._apply)

    def _create_interfaces(self) -> None:
        self._command = self.create_publisher(JointState, 'joint_command', PUBLISH)
        self._forward = (
            self.create_publisher(
                Float64MultiArray, 'forward_position_controller/commands', PUBLISH
            )
            if self._settings.forward_commands
            else None
        )
        numbers = (
            'joint_velocity_norm',
            'joint_acceleration_norm',
            'null_velocity_norm',
            'joint_torque_norm',
            'min_singular_value',
        )
        self._telemetry = Telemetry(
            self, {'tip_pose': PoseStamped, **dict.fromkeys(numbers, Float64), 'law': String}
        )
        self._refusals = Refusals(self)
        self._watchdog = Watchdog(self, 'joint_states', self._settings.state_timeout)
        self._diagnostics = Diagnostics(self, self._robot.robot, self._health)
        self.create_subscription(JointState, 'joint_states', self._on_state, NEWEST)
        self.create_subscription(TwistStamped, 'cartesian_velocity', self._on_twist, NEWEST)
        self.create_subscription(String, 'sim/session_state', self._on_session, LATCHED)
        self.create_service(SetBool, 'controller/hold', self._on_hold)

    def _on_state(self, message: JointState) -> None:
        self._watchdog.feed()
        stamp = to_nanoseconds(message.header.stamp)
        if stamp == self._stamp:
            self._command.publish(
                self._answer.message
            )  # asked again, as in lock-step: the same answer
        elif self._settings.lockstep and self._twist.stamp != stamp:
            self._waiting = message
        else:
            self._reply(stamp, message)

    def _on_twist(self, message: TwistStamped) -> None:
        try:
            dx = from_twist(message, self._frame, len(self._twist.dx))
        except RedresError as error:
            self._refusals.refuse('cartesian_velocity', error)
            return
        self._refusals.accept('cartesian_velocity')
        self._twist = _Twist(
            to_nanoseconds(message.header.stamp) or self._stamp, dx
        )  # a zero stamp means now
        if self._waiting and to_nanoseconds(self._waiting.header.stamp) == self._twist.stamp:
            waiting = self._waiting
            self._waiting = None
            self._reply(self._twist.stamp, waiting)

    def _reply(self, stamp: int, message: JointState) -> None:
        try:
            command = self._update(stamp, self._joints.positions(message))
        except RedresError as error:
            self._refusals.refuse('joint_states', error)
            return
        self._command.publish(self._answer.filled(stamp, command.q_ref, command.dq))
        self._stamp = stamp
        self._answered += 1
        self._refusals.accept('joint_states')
        self._publish_rest(stamp, command)

    def _update(self, stamp: int, q: np.ndarray) -> Command:
        cycles = self._cycles_since_last(stamp)
        commanding = self._commanding and stamp >= self._silent_until
        if not commanding or cycles > 1 + self._settings.bridged_misses or not self._followed(q):
            # the arm stands still, or is too far on to go on from the last command
            self._controller.reset()
            cycles = 1
        self._skipped += cycles - 1
        age = (stamp - self._twist.stamp) / NANOSECONDS
        if self._held or not self._twist.stamp or abs(age) > self._settings.command_timeout:
            self._controller.hold()
        else:
            self._controller.resume()
        return self._controller.update(q, self._twist.dx, missed=cycles - 1)

    def _followed(self, q: np.ndarray) -> bool:
        """Whether the arm goes where it is told; a robot may stop it without a word, or the word
        may get lost.
        """
        lag = self._controller.lag(q)
        allowed = self._settings.following_tolerance
        if lag > allowed:
            self.get_logger().warning(
                f'the arm does not follow: a joint is {lag:.3g} rad from its reference, allowed '
                f'{allowed:g}; starting anew from the measurement',
                throttle_duration_sec=5.0,
            )
        return lag <= allowed

    def _cycles_since_last(self, stamp: int) -> int:
        """Cycles from the state answered last to this one; 1 in the beginning and where the clock
        has been set anew.
        """
        elapsed = stamp - self._stamp
        if not self._stamp or abs(elapsed) > _NEW_CLOCK:
            self._controller.reset()
            self._silent_until = (
                stamp + _SESSION_PATIENCE if self._stamp and self._has_session else 0
            )
            return 1
        cycles = round(elapsed / self._period)
        if cycles < 1 or abs(elapsed - cycles * self._period) > self._period / 10:
            raise StampError(
                f'stamped {elapsed / 1e6:g} ms after the last; expected a multiple of '
                f'{self._period / 1e6:g} ms (rate {self._settings.rate:g} Hz)'
            )
        return cycles

    def _publish_rest(self, stamp: int, command: Command) -> None:
        """What can wait until the command is out."""
        if self._forward:
            self._forward.publish(Float64MultiArray(data=command.q_ref.tolist()))
        if self._telemetry.heard:
            norm = np.linalg.norm
            publish = self._telemetry.publish
            state = command.state
            publish('tip_pose', lambda: to_pose(stamp, self._frame, state.x, state.R))
            publish('joint_velocity_norm', lambda: float(norm(command.dq)))
            publish('joint_acceleration_norm', lambda: float(norm(command.ddq)))
            publish('null_velocity_norm', lambda: float(norm(command.null)))
            publish('joint_torque_norm', lambda: float(norm(command.tau)))
            publish('min_singular_value', lambda: command.min_singular_value)
            publish('law', lambda: law_name(self._controller.law))

    def _on_session(self, message: String) -> None:
        self._has_session = True
        self._silent_until = 0
        self._has_commanded |= message.data in COMMANDING
        # In lock-step the first answer begins command mode; the tick in which the news of that
        # arrives must not matter.
        self._commanding = message.data in COMMANDING or (
            self._settings.lockstep and not self._has_commanded
        )

    def _on_hold(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._held = request.data
        response.success = True
        response.message = 'holding' if request.data else 'following cartesian_velocity'
        return response

    def _check(self, changes: dict[str, Any]) -> None:
        self._law_parameters.changed(changes).check_damping(self._controller.T)

    def _apply(self, changes: dict[str, Any]) -> None:
        self._controller.switch_law(self._law_parameters.apply(changes))
        live = {name: value for name, value in changes.items() if hasattr(self._settings, name)}
        self._settings = replace(self._settings, **live)
        self._controller.switch_time = self._settings.switch_time

    def _health(self) -> Health:
        law = self._controller.law
        figures = {
            'law': law_name(law),
            'damping [1/s]': law.damping,
            'forgetting factor': law.forgetting(self._controller.T),
            'states answered': self._answered,
            'states skipped': self._skipped,
            'messages refused': self._refusals.count,
        }
        if self._watchdog.silent:
            return Health(ERROR, 'no joint_states', figures)
        if self._refusals.reasons:
            return Health(WARN, self._refusals.reasons, figures)
        return Health(
            OK,
            'commanding' if self._commanding else 'mirroring: the robot takes no commands',
            figures,
        )


def main(arguments: list[str] | None = None) -> int:
    """Console entry point."""
    return run_nodes(ControllerNode, arguments=arguments)


if __name__ == '__main__':
    sys.exit(main())
