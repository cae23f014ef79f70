"""Node `sim`: a fake KUKA LWR behind its Fast Research Interface. It is the clock of the graph."""

import math
import sys
import threading
import time
from dataclasses import asdict, dataclass

import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

from redres_ros.errors import RedresError
from redres_ros.fri.connection import Quality
from redres_ros.fri.guard import Guard, GuardSettings
from redres_ros.fri.limits import JointLimits
from redres_ros.fri.plant import IdealPlant, MujocoPlant, MujocoSettings
from redres_ros.fri.robot import Answer, FriRobot, Plant
from redres_ros.fri.session import Session, SessionSettings, State
from redres_ros.nodes.conversions import NANOSECONDS, JointOrder, to_joint_state, to_nanoseconds
from redres_ros.nodes.diagnostics import ERROR, OK, WARN, Diagnostics, Health, Refusals
from redres_ros.nodes.parameters import declare, declare_robot
from redres_ros.nodes.runtime import LATCHED, NEWEST, PUBLISH, run_node
from redres_ros.parameter import param
from redres_ros.robots import Arm
from redres_ros.tasks import load_task

LOCKSTEP_EPOCH = NANOSECONDS  # stamp of the first state in lock-step [ns]; a stamp of zero would mean now

_ASK_AGAIN = 0.05  # [s] a state whose answer is waited for is published again after that long: it may have got lost
_REMEMBERED = 256  # ticks whose time of sending is kept, to know the latency of their answers


class StampError(RedresError):
    """A command that answers no state."""


@dataclass(frozen=True)
class SimParameters:
    """Parameters of the node beside those of the arm, its physics, the session and the guard."""

    rate: float = param(500.0, 'cycles per second [Hz]', 10.0, 2000.0)
    plant: str = param('mujoco', 'mujoco: physics behind position servos; ideal: goes exactly where it is told',
                       choices=('mujoco', 'ideal'))
    start: tuple[float, ...] = param(tuple(load_task('rectangle').start.tolist()), 'joint positions at the start [rad]')
    patience: float = param(0.0, 'how long the clock stands still for an answer that is late; 0 as a real robot [s]', 0.0, 60.0)
    lockstep: bool = param(False, 'wait for the answer to each state instead of keeping time')


class SimNode(Node):
    """Publishes a state each cycle, and moves the arm while the answer is being computed."""

    def __init__(self) -> None:
        super().__init__('sim')
        self._description, self._settings = declare_robot(self, dynamics='lwr'), declare(self, SimParameters())
        arm, period = self._description.arm, 1.0 / self._settings.rate
        plant = self._make_plant(arm, period)
        guard = Guard(JointLimits.of(arm), period, declare(self, GuardSettings()))
        self._session = Session(period, declare(self, SessionSettings()))
        self._cycles_waited, self._stood_still = 0, 0.0  # cycles in which the clock stood still, and for how long [s]
        self._robot = FriRobot(plant, guard, self._session)
        self._joints, self._period = JointOrder(plant.joint_names), round(NANOSECONDS / self._settings.rate)
        self._epoch = LOCKSTEP_EPOCH if self._settings.lockstep else self.get_clock().now().nanoseconds
        self._sent = np.zeros(_REMEMBERED)  # [s] when the states of the last ticks went out, by the robot's clock
        self._received: tuple[JointState | None, float] = (None, 0.0)  # newest command, and when it came [s]
        self._arrival, self._client_lives = threading.Event(), False
        self._reset_wanted, self._stopped_at = False, 0  # stamp [ns] of the tick after the last stop
        self._create_interfaces(arm)

    def _make_plant(self, arm: Arm, period: float) -> Plant:
        physics, start = declare(self, MujocoSettings()), np.array(self._settings.start)
        if self._settings.plant == 'mujoco':
            return MujocoPlant(arm, period, start, physics)
        return IdealPlant(JointLimits.of(arm).joint_names, period, start)

    def _create_interfaces(self, arm: Arm) -> None:
        self._states = self.create_publisher(JointState, 'joint_states', PUBLISH)
        topics = ('sim/session_state', 'sim/connection_quality', 'sim/stop_reason', 'robot_description')
        self._latched = {topic: self.create_publisher(String, topic, LATCHED) for topic in topics}
        self._told = dict.fromkeys(topics)
        self._tell('robot_description', arm.description())
        self._tell_session()
        self._refusals = Refusals(self)
        self._diagnostics = Diagnostics(self, self._description.robot, self._health)
        self.create_subscription(JointState, 'joint_command', self._on_command, NEWEST)
        self.create_service(Trigger, 'sim/reset', self._on_reset)

    def run(self, stopped: threading.Event) -> None:
        """Cycle after cycle until the event is set; the executor runs in another thread.

        At tick k the arm takes up the answer to the state of tick k - 1, and goes on its way to tick k + 1 while the
        state of tick k is being answered. When this process was held up, or waited with patience, the robot's clock
        stood still for that long: its stamps are always exactly one period apart.
        """
        wait = self._wait_for_answer if self._settings.lockstep else self._wait_for_tick
        self._due = time.monotonic()
        while not stopped.is_set():
            received = self._received  # before the next state is out: what comes after that may answer it already
            self._publish_state()
            if self._reset_wanted:
                self._reset_wanted = False
                self._robot.reset()
            self._robot.advance(self._to_answer(*received))
            self._tell_session()
            wait(stopped)

    def close(self) -> None:
        """Tell the final figures."""
        self._diagnostics.publish()

    def _publish_state(self) -> None:
        tick = self._robot.tick
        self._state = to_joint_state(self._stamp(tick), self._joints.names, self._robot.q, self._robot.dq)
        self._arrival.clear()
        self._sent[tick % _REMEMBERED] = time.monotonic() - self._stood_still
        self._states.publish(self._state)

    def _to_answer(self, command: JointState | None, arrived: float) -> Answer | None:
        """A command as an answer to a tick before this one; None where there is none that can be used."""
        if command is None:
            return None
        try:
            tick, rest = divmod(to_nanoseconds(command.header.stamp) - self._epoch, self._period)
            if rest or not 0 <= tick < self._robot.tick:
                raise StampError(f'stamp {to_nanoseconds(command.header.stamp)} ns is that of no state sent so far')
            q = self._joints.positions(command)
        except RedresError as error:
            self._refusals.refuse('joint_command', error)
            return None
        self._refusals.accept('joint_command')
        latency = 0.0 if self._settings.lockstep else arrived - self._stood_still - self._sent[tick % _REMEMBERED]
        return Answer(tick, q, latency)

    def _wait_for_tick(self, stopped: threading.Event) -> None:
        self._due += self._period / NANOSECONDS
        late = time.monotonic() - self._due
        if late < 0.0:
            time.sleep(-late)
        elif late > self._period / NANOSECONDS:
            self._stand_still(late)  # held up by more than a cycle: go on from here, without a burst
        if self._settings.patience and self._client_lives and self._unanswered() > 0:
            self._wait_for_answer(stopped, self._settings.patience)
            self._client_lives = self._unanswered() == 0  # do not wait again until a command comes
            self._cycles_waited += 1
            self._stand_still(time.monotonic() - self._due)

    def _stand_still(self, seconds: float) -> None:
        self._stood_still += seconds
        self._due += seconds

    def _wait_for_answer(self, stopped: threading.Event, patience: float = math.inf) -> None:
        until = time.monotonic() + patience
        while self._unanswered() > 0 and not stopped.is_set() and time.monotonic() < until:
            if not self._arrival.wait(_ASK_AGAIN):
                self._states.publish(self._state)
            self._arrival.clear()

    def _unanswered(self) -> int:
        """States sent since the one that the newest command answers."""
        command, _ = self._received
        newest = to_nanoseconds(self._state.header.stamp)
        return (newest - (to_nanoseconds(command.header.stamp) if command else self._epoch - self._period)) // self._period

    def _on_command(self, message: JointState) -> None:
        self._received, self._client_lives = (message, time.monotonic()), True
        self._arrival.set()

    def _on_reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._reset_wanted = True
        reason = self._session.reason
        response.success, response.message = True, f'cleared: {reason}' if reason else 'nothing to clear; monitoring anew'
        return response

    def _tell_session(self) -> None:
        if self._session.reason and self._session.reason != self._told['sim/stop_reason']:
            self._stopped_at = self._stamp(self._robot.tick)
            self.get_logger().error(self._session.reason)
        self._tell('sim/stop_reason', self._session.reason)
        self._tell('sim/session_state', self._session.state.value)
        self._tell('sim/connection_quality', self._session.quality.name)

    def _tell(self, topic: str, text: str) -> None:
        if text != self._told[topic]:
            self._told[topic] = text
            self._latched[topic].publish(String(data=text))

    def _health(self) -> Health:
        session = self._session
        figures = {**asdict(session.statistics), 'session state': session.state.value, 'quality': session.quality.name,
                   **asdict(session.counts), 'cycles waited for': self._cycles_waited, 'clock stood still [s]': self._stood_still,
                   'stopped at [ns]': self._stopped_at}
        if session.reason:
            return Health(ERROR, session.reason, figures)
        if session.quality is not Quality.PERFECT or self._refusals.reasons:
            return Health(WARN, self._refusals.reasons or f'connection {session.quality.name}', figures)
        return Health(OK, 'in command' if session.state is State.CMD else 'monitoring', figures)

    def _stamp(self, tick: int) -> int:
        return self._epoch + tick * self._period


def main(arguments: list[str] | None = None) -> int:
    """Console entry point."""
    return run_node(SimNode, arguments)


if __name__ == '__main__':
    sys.exit(main())
