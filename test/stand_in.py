"""What stands in for a robot behind ros2_control, in virtual time, and who judges its commands.

Topics, types, order of names and stamps are those of a joint_state_broadcaster and a
forward_position_controller: states are stamped by the computer's clock, at which the update began;
a command is numbers in the order of the joints, the newest of which is taken up at the next update.

Their life cycle is that of ros2_control 4.46: the forward_position_controller begins without a
command each time it is activated, the hardware holds the last one that was written, and a command
of a wrong length deactivates the controller. An error of the hardware's read() ends both.
"""

import random
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from rcl_interfaces.srv import GetParameters
from rclpy.parameter import Parameter
from reference_judge import ReferenceJudge
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from virtual_graph import Graph, on_wires

from redres_ros.geometry import quintic
from redres_ros.nodes.controller import ControllerNode
from redres_ros.nodes.conversions import to_joint_state
from redres_ros.nodes.planner import PlannerNode
from redres_ros.robots.joint_limits import JointLimits

COMMANDS = 'forward_position_controller/commands'
PARAMETERS = 'forward_position_controller/get_parameters'
ROUNDING = 1e-9
IN_A_BURST = 20e-6  # [s] from one update to the next, of those that an overrun has held up


class Judge(Protocol):
    """Says why a command would have ended the motion; empty if it would not."""

    def verdict(self, q: np.ndarray) -> str:
        """Of the command q (n,) that is carried out in this cycle."""


class LbrGuard:
    """The command guard of lbr_fri_ros2, in its stricter variant.

    Positions stay a cycle at full speed away from their limits; from one measurement to the next no
    joint is faster than its limit.
    """

    def __init__(self, limits: JointLimits, T: float) -> None:
        self._limits = limits
        self._T = T
        self._before: np.ndarray | None = None

    def verdict(self, q: np.ndarray) -> str:
        limits = self._limits
        margin = limits.velocity * self._T
        if ((q < limits.lower + margin) | (q > limits.upper - margin)).any():
            return f'position not in limits: {q}'
        before = self._before
        self._before = q  # the arm is ideal
        if before is not None and (np.abs(q - before) / self._T > limits.velocity).any():
            return f'velocity not in limits: {(q - before) / self._T}'
        return ''


class Slowing:
    """The velocity limits of FR3, which fall towards the ends of the ranges: sqrt(k d) - c.

    The numbers are those of Franka's documentation and of libfranka's rate limiter.
    """

    c = np.array((0.30, 0.20, 0.20, 0.30, 0.35, 0.35, 0.35))  # [rad/s]
    k = np.array((12.0, 5.17, 7.0, 8.0, 34.0, 11.0, 34.0))  # [rad/s^2]
    lower = -np.array((2.7501, 1.7918, 2.9065, 3.0481, 2.8101, -0.54092, 3.0196))  # [rad]
    upper = np.array((2.7501, 1.7918, 2.9065, -0.1458, 2.8101, 4.5205, 3.0196))  # [rad]

    def fastest(self, q: np.ndarray, limits: JointLimits) -> tuple[np.ndarray, np.ndarray]:
        """Least and largest velocity at q, (n,) [rad/s] each."""
        down = np.sqrt(self.k * np.maximum(q - self.lower, 0.0)) - self.c
        up = np.sqrt(self.k * np.maximum(self.upper - q, 0.0)) - self.c
        slowest = np.zeros_like(q)
        return -np.clip(down, slowest, limits.velocity), np.clip(up, slowest, limits.velocity)


class FrankaRules:
    """What a Franka arm asks of joint positions: differences over 1 ms within the limits."""

    jerk = 5000.0  # [rad/s^3]

    def __init__(self, limits: JointLimits, T: float) -> None:
        self._limits = limits
        self._T = T
        self.slowing: Slowing | None = None  # near the ends of the ranges
        self._last: list[np.ndarray] = []  # q, dq, ddq

    def verdict(self, q: np.ndarray) -> str:
        if not self._last:
            self._last = [q, np.zeros_like(q), np.zeros_like(q)]
        dq = (q - self._last[0]) / self._T
        ddq = (dq - self._last[1]) / self._T
        dddq = (ddq - self._last[2]) / self._T
        self._last = [q, dq, ddq]
        limits = self._limits
        if ((q < limits.lower) | (q > limits.upper)).any():
            return 'joint_motion_generator_position_limits_violation'
        fastest = (-limits.velocity, limits.velocity)
        if self.slowing:
            fastest = self.slowing.fastest(q, limits)
        if (dq < fastest[0]).any() or (dq > fastest[1]).any():
            return 'joint_motion_generator_velocity_limits_violation'
        if (np.abs(ddq) > limits.acceleration + ROUNDING / self._T**2).any():
            return 'joint_motion_generator_velocity_discontinuity'
        if (np.abs(dddq) > self.jerk + ROUNDING / self._T**3).any():
            return 'joint_motion_generator_acceleration_discontinuity'
        return ''


def fr3_rules(limits: JointLimits, T: float) -> FrankaRules:
    rules = FrankaRules(limits, T)
    rules.slowing = Slowing()
    return rules


@dataclass(frozen=True)
class Habits:
    """How a robot behind ros2_control differs from the ideal one."""

    others: Sequence[str] = ()  # further joints in its states, of a gripper
    jitter: float = 0.2  # of the stamps, to either side, as a fraction of the period
    dropped: float = 0.0  # fraction of the states, as the broadcaster is still sending the last
    velocities: bool = True  # are measured; else they are NaN
    servo: float = 0.0  # time constant with which the arm follows its commands [s]; 0: at once
    # speed of a simulation's clock, which begins at zero; 0: it is the computer's
    simulated: float = 0.0


class StandIn:
    """A robot that follows its commands; the limits are in the order of the controller's joints."""

    def __init__(
        self,
        graph: Graph,
        limits: JointLimits,
        q: np.ndarray,
        rate: float,
        judge: Judge | None = None,
        habits: Habits | None = None,
    ) -> None:
        self.q = q  # where the arm is, (n,) [rad]
        self.commands = 0
        self.complaints: list[str] = []
        self.way = [q]  # the commands that were written
        self.forwarding = True  # the forward_position_controller is active
        self.broadcasting = True  # the joint_state_broadcaster is active
        self.hardware = ReferenceJudge(limits, 1.0 / rate, 'hold')  # of what is written to it
        self._graph = graph
        self._period = 1.0 / rate
        self._judge = judge
        self._random = random.Random(0)
        self._habits = habits or Habits()
        self._epoch = graph.clock.time_ns() if self._habits.simulated else 0  # [ns]
        self._pace = self._habits.simulated or 1.0
        self._joints = limits.joint_names
        self._names = sorted((*limits.joint_names, *self._habits.others))
        self._reference: np.ndarray | None = None  # the controller's newest; None: NaN
        self._trajectory: list[np.ndarray] = []  # of the joint_trajectory_controller
        self._written = q  # to the hardware, which holds it
        self._is_new = True  # since the last cycle of the hardware
        self._cycle = 0
        self._stamp = 0  # of the newest state [ns]
        self._owed = 0  # updates that an overrun holds up
        self._held_up_until = 0.0
        graph.services[PARAMETERS] = (GetParameters, self._on_get_parameters)
        graph.listen(COMMANDS, 'robot', self._on_command)
        graph.clock.repeat(self._period / self._pace, self._on_cycle)

    def activate(self) -> None:
        """Activate the forward_position_controller in place of any other; commands of before are
        discarded.
        """
        self._reference = None
        self._trajectory = []
        self.forwarding = True

    def deactivate(self) -> None:
        self._reference = None
        self.forwarding = False

    def carry(self, way: np.ndarray, seconds: float) -> None:
        """Have the joint_trajectory_controller move the arm by `way` (n,) in place of the forward
        one.
        """
        self.deactivate()
        self.hardware.forget()
        times = np.arange(1, round(seconds / self._period) + 1) * self._period
        self._trajectory = [self._written + quintic(t / seconds)[0] * way for t in times]

    def fail_read(self) -> None:
        """Have the hardware's read() fail: it is unconfigured, its controllers are inactive."""
        self.deactivate()
        self.broadcasting = False

    def put(self, q: np.ndarray) -> None:
        """Move the arm by hand, while nothing is written; the hardware begins there."""
        self.q = q
        self._written = q
        self._is_new = False
        self.hardware.forget()

    def recover(self) -> None:
        """Configure and activate the hardware and both controllers again."""
        self.activate()
        self.broadcasting = True

    def overrun(self, seconds: float) -> None:
        """Hold up the controller_manager for some time; then it makes up for its updates."""
        self._held_up_until = self._graph.clock.now + seconds

    def _on_get_parameters(
        self, request: GetParameters.Request, response: GetParameters.Response
    ) -> GetParameters.Response:
        joints = Parameter('joints', value=list(self._joints))
        response.values = [joints.get_parameter_value() for _ in request.names]
        return response

    def _on_command(self, message: Float64MultiArray) -> None:
        self.commands += 1
        if not self.forwarding:
            return
        if len(message.data) != len(self._joints):
            self.deactivate()
            return
        self._reference = np.array(message.data)

    def _on_cycle(self) -> None:
        """One period of the hardware and, unless that is held up, of the controller_manager."""
        self._move()
        self._owed += 1
        if self._graph.clock.now < self._held_up_until:
            return
        for k in range(self._owed):
            self._graph.clock.call_in(k * IN_A_BURST, self._update)
        self._owed = 0

    def _move(self) -> None:
        self._cycle += 1
        if self._is_new:
            self.hardware.enter_reference(round(1e9 * self._cycle * self._period), self._written)
            self._is_new = False
        share = 1.0 if not self._habits.servo else 1.0 - np.exp(-self._period / self._habits.servo)
        self.q = self.q + share * (self._written - self.q)

    def _update(self) -> None:
        """The state is published before commands are taken up, as the broadcaster comes first."""
        command = self._trajectory.pop(0) if self._trajectory else self._reference
        if self.broadcasting and self._random.random() >= self._habits.dropped:
            self._graph.publish('joint_states', self._state())
        if command is None:
            return
        if self._judge and (complaint := self._judge.verdict(command)):
            self.complaints.append(complaint)
        self._is_new = self._is_new or command is not self._written
        self._written = command
        self.way.append(command)

    def _state(self) -> JointState:
        habits = self._habits
        positions: Mapping[str, float] = dict(zip(self._joints, self.q.tolist(), strict=True))
        values = np.array([positions.get(name, 0.02) for name in self._names])
        velocities = np.full(len(values), 0.0 if habits.velocities else np.nan)
        delay = self._random.uniform(-habits.jitter, habits.jitter) * self._period
        # The stamp is of the update's beginning; in a burst one comes right after the other.
        now = round(self._pace * (self._graph.clock.time_ns() - self._epoch))
        stamp = max(now + round(1e9 * delay), self._stamp + 1000)
        self._stamp = stamp
        state: JointState = to_joint_state(stamp, self._names, values, velocities)
        return state


@contextmanager
def behind_ros2_control(parameters: Path | Sequence[str], description: str = '') -> Iterator[Graph]:
    """A controller and a planner with parameters, from a file or words such as 'rate:=100.0', on
    the wires for a robot whose description may be published.
    """
    if isinstance(parameters, Path):
        words = ['--params-file', str(parameters)]
    else:
        words = [word for parameter in parameters for word in ('-p', parameter)]
    graph = Graph()
    if description:
        graph.publish('robot_description', String(data=description), latched=True)
    with on_wires(graph, (ControllerNode, PlannerNode), *words):
        yield graph
