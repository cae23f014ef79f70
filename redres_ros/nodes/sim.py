"""Node `sim`: a fake robot controller with a simulated arm. It is the clock of the graph."""

import math
import threading
import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

from redres_ros.fake_robot.command_receiver import CommandReceiver
from redres_ros.fake_robot.faults import Faults, NetworkModel
from redres_ros.fake_robot.mujoco_arm import EnvironmentSettings
from redres_ros.fake_robot.plant import FaultyPlant, IdealPlant, MujocoPlant
from redres_ros.fake_robot.robot import FakeRobot
from redres_ros.fake_robot.robot_clock import NANOSECONDS, RobotClock
from redres_ros.fake_robot.session import CommandError, SessionSettings
from redres_ros.nodes.conversions import to_joint_state, to_nanoseconds, to_time
from redres_ros.nodes.diagnostics import Diagnostics, Health
from redres_ros.nodes.lifecycle import ManagedNode
from redres_ros.nodes.markers import show_obstacles
from redres_ros.nodes.parameters import (
    LoopParameters,
    ParameterError,
    declare,
    on_live_change,
    with_changes,
)
from redres_ros.nodes.robot_parameters import declare_robot
from redres_ros.nodes.runtime import Spinner
from redres_ros.nodes.topics import (
    LATCHED,
    NEWEST,
    PUBLISH,
    QUALITY,
    REASON,
    SESSION,
    STEADY,
    LatchedWords,
    Telemetry,
)
from redres_ros.parameter import param
from redres_ros.robots.joint_limits import JointLimits
from redres_ros.robots.scene import touched
from redres_ros.types import Nanoseconds, Seconds

# Fraction of a cycle left to the client before the arm moves on: the two would compete for the
# processor.
_HEADSTART = 0.5
_LOOK = 0.1  # [s] between counts of the publishers of commands
_ASK_AGAIN = 0.05  # [s] after which a state without a command is sent again: it may be lost


@dataclass(frozen=True)
class _SimParameters(LoopParameters):
    """Parameters of the node beside those of the arm, its environment, session and faults."""

    plant: str = param(
        'mujoco',
        'mujoco: physics behind position servos; ideal: follows every command exactly',
        choices=('mujoco', 'ideal'),
    )
    start: tuple[float, ...] = param((), 'joint positions at the start [rad]')
    patience: float = param(
        1.0,
        'how long the clock waits for a late command; 0: not at all, like a real robot [s]',
        0.0,
        60.0,
    )
    lockstep: bool = param(
        False, 'wait for the command to each state instead of running in real time'
    )


class SimNode(ManagedNode):
    """Publishes a state each cycle, and moves the arm while the response is computed.

    The clock stands still while this process is held up, and while it waits for a command with
    patience: as long as the arm moves, stamps are exactly one period apart. In lock-step no clock
    is kept.

    Deactivated it neither sends states nor takes commands, as a robot whose cable is cut; activated
    again, it starts monitoring again. Raises ParameterError for use_sim_time.
    """

    def __init__(self) -> None:
        super().__init__('sim')
        if self.get_parameter('use_sim_time').value:
            raise ParameterError(
                'use_sim_time is True; allowed: False: the fake arm uses the clock of the '
                'computer, and publishes no /clock'
            )
        robot, arm = declare_robot(self, is_the_robot=True, has_dynamics=False)
        self._tip_frame = arm.tip_frame
        settings = self._settings = declare(self, _SimParameters(start=arm.start))
        environment = declare(self, EnvironmentSettings())
        session = declare(self, SessionSettings())
        if settings.lockstep:
            session = replace(session, monitor_time=0.0)  # timing is perfect
        period = 1.0 / settings.rate
        limits = JointLimits.of(arm)
        start = np.array(settings.start)
        plant: MujocoPlant | IdealPlant
        if settings.plant == 'mujoco':
            plant = MujocoPlant(arm, period, start, environment=environment)
        else:
            plant = IdealPlant(limits.joint_names, period, start)
        self._plant = FaultyPlant(plant, declare(self, Faults()))
        self._robot = FakeRobot(self._plant, limits, session)
        self._session = self._robot.session
        # a stamp of zero would mean now
        epoch = NANOSECONDS if settings.lockstep else time.time_ns()
        self._robot_clock = RobotClock(epoch, round(NANOSECONDS / settings.rate))
        timed = not settings.lockstep
        self._receiver = CommandReceiver(self._robot, self._robot_clock, timed=timed)
        self._states = NetworkModel[JointState]('states')
        self._set_faults({})
        self._newest = JointState()  # of the published states
        self._arrival = threading.Event()  # of a command
        self._diagnostics = Diagnostics(self, robot, self._health)
        self._reported_refusal: CommandError | None = None
        self._client_lives = False
        self._cycles_waited = 0
        self._create_interfaces(arm.description(), arm.kinematics().base_frame)
        self._start_life()

    def _create_interfaces(self, description: str, base_frame: str) -> None:
        types = {'wrench': WrenchStamped, 'external_torques': JointState}
        self._telemetry = Telemetry(self, types)
        self._state_publisher = self.create_publisher(JointState, 'joint_states', PUBLISH)
        # The reason comes first: a subscriber that receives the end of a session knows why.
        self._words = LatchedWords(self, REASON, SESSION, QUALITY)
        self._publish_session()
        description_publisher = self.create_publisher(String, 'robot_description', LATCHED)
        description_publisher.publish(String(data=description))
        self.create_subscription(JointState, 'joint_command', self._on_command, NEWEST)
        self.create_service(Trigger, 'sim/reset', self._on_reset)
        show_obstacles(self, base_frame, touched, 'contact')
        self.create_timer(_LOOK, self._look, clock=STEADY)
        on_live_change(self, self._check_faults, self._set_faults)

    def run(self, stopped: threading.Event, spinner: Spinner) -> None:
        """Cycle after cycle until the event is set; callbacks run by the spinner while it waits.

        At tick k the arm takes up the command for the state of tick k - 1, and moves on to tick
        k + 1 while the client responds to the state of tick k.
        """
        lockstep = self._settings.lockstep
        self._robot_clock.restart()
        while not stopped.is_set():
            if lockstep and not self.active:
                spinner.wait(_ASK_AGAIN)
                continue
            # Before the next state is out: what comes later may be a command for that one.
            commands = self._receiver.take()
            self._publish_state()
            if not lockstep:
                spinner.wait(_HEADSTART / self._settings.rate, self._arrival)
            self._robot.advance(*commands)
            self._publish_session()
            if lockstep:
                # The command may have come already, in this thread; services still need a turn.
                spinner.wait(0.0)
                self._await_command(stopped, spinner, math.inf)
            else:
                self._keep_time(stopped, spinner)

    def destroy_node(self) -> None:
        self._diagnostics.publish()
        super().destroy_node()  # type: ignore[no-untyped-call]

    def _publish_session(self) -> None:
        """Publish what has changed since the last call; a stop and a refused command are logged."""
        session = self._session
        refused = session.command_error
        if refused is None:
            self._diagnostics.accept('joint_command')
        elif refused is not self._reported_refusal:
            self._diagnostics.refuse('joint_command', refused)
        self._reported_refusal = refused
        if session.reason and session.reason != self._words.published.get(REASON):
            self.get_logger().error(session.reason)
        self._words.publish(
            {REASON: session.reason, SESSION: session.state, QUALITY: session.quality}
        )

    def _publish_state(self) -> None:
        tick = self._robot.tick
        stamp = self._robot_clock.send(tick)
        self._arrival.clear()
        # Before the state, so that a controller has them when it responds.
        self._telemetry.publish('wrench', lambda: self._wrench(stamp))
        plant = self._plant
        names = plant.joint_names
        self._telemetry.publish(
            'external_torques',
            lambda: to_joint_state(stamp, names, effort=plant.true.external_torques),
        )
        state = to_joint_state(stamp, names, plant.q, plant.dq, plant.true.effort)
        self._states.send(state, tick)
        if self.active:
            for arriving in self._states.receive(tick):
                self._state_publisher.publish(arriving)
                self._newest = max(self._newest, arriving, key=_stamp)

    def _wrench(self, stamp: Nanoseconds) -> WrenchStamped | None:
        measured = self._plant.wrench
        if measured is None:
            return None
        message = WrenchStamped()
        message.header.stamp = to_time(stamp)
        message.header.frame_id = self._tip_frame
        force = message.wrench.force
        torque = message.wrench.torque
        force.x, force.y, force.z, torque.x, torque.y, torque.z = measured.tolist()
        return message

    def _keep_time(self, stopped: threading.Event, spinner: Spinner) -> None:
        """Wait until the next tick is due, and up to `patience` for a late response."""
        self._robot_clock.wait(spinner.wait)
        if self._settings.patience and self._client_lives and self._awaits_command:
            self._await_command(stopped, spinner, self._settings.patience)
            # A client that was silent for so long is not waited for again until it sends a command.
            self._client_lives = not self._awaits_command
            self._cycles_waited += 1
            self._robot_clock.stand_still()

    def _await_command(self, stopped: threading.Event, spinner: Spinner, patience: Seconds) -> None:
        until = time.monotonic() + patience
        while self._awaits_command and time.monotonic() < until:
            if stopped.is_set() or not self.active:
                return
            if not spinner.wait(_ASK_AGAIN, self._arrival):
                self._state_publisher.publish(self._newest)  # it may have been lost
            self._arrival.clear()

    @property
    def _awaits_command(self) -> bool:
        """Whether a published state, not lost or delayed by a fault, has no response."""
        return self._receiver.newest < _stamp(self._newest)

    def _on_command(self, message: JointState) -> None:
        if not self.active:
            return
        with self._diagnostics.judging('joint_command'):
            self._receiver.put(_stamp(message), message.name, np.array(message.position))
            self._client_lives = True
            self._arrival.set()

    def _on_reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        reason = self._session.reason
        self._session.reset()
        message = f'cleared: {reason}' if reason else 'nothing to clear; monitoring starts again'
        return Trigger.Response(success=True, message=message)

    def _begin(self) -> None:
        self._session.reset()

    def _look(self) -> None:
        self._receiver.publishers = self.count_publishers('joint_command')

    def _check_faults(self, changes: dict[str, Any]) -> None:
        self._plant.check(with_changes(self._plant.faults, changes))

    def _set_faults(self, changes: dict[str, Any]) -> None:
        faults = self._plant.faults = with_changes(self._plant.faults, changes)
        self._states.set_faults(faults.state_delay, faults.state_loss, faults.disorder)
        commands = self._receiver.network
        commands.set_faults(faults.command_delay, faults.command_loss, faults.disorder)

    def _health(self) -> Health:
        session = self._session
        timing = session.timing
        figures = {
            **timing.statistics,
            'session state': session.state,
            'quality': session.quality,
            'at fault': timing.at_fault,
            **timing.counts,
            **{f'refused: {kind}': count for kind, count in session.refusals.items()},
            'cycles waited for': self._cycles_waited,
            'clock stood still [s]': self._robot_clock.stood_still,
        }
        warning = f'connection {session.quality}: {timing.at_fault}' if timing.at_fault else ''
        state = 'in command' if session.commanding else 'monitoring'
        return Health(figures, state, warning, session.reason)


def _stamp(message: JointState) -> Nanoseconds:
    return to_nanoseconds(message.header.stamp)
