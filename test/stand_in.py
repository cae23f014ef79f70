"""What stands in for a robot behind ros2_control, in virtual time, and who judges its commands.

Topics, types, order of names and stamps are those of a joint_state_broadcaster and a
forward_position_controller: states are stamped by the computer's clock, at which the update began;
a command is numbers in the order of the joints, the newest of which is taken up at the next update.
"""

import random
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol
from unittest import mock

import numpy as np
import rclpy
from graph_helpers import to_joint_state
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from virtual_graph import Graph, VirtualTime, _Wired

from redres_ros.demo.processes import own_domain
from redres_ros.nodes.controller import ControllerNode
from redres_ros.nodes.planner import PlannerNode
from redres_ros.robots.joint_limits import JointLimits

COMMANDS = 'forward_position_controller/commands'
EPOCH = 1_700_000_000 * 10**9  # [ns]
ROUNDING = 1e-9


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
        self._before = q  # the arm is where it was told to be
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
    """Those of an FR3.

    Args:
        limits: Of its joints.
        T: Its cycle [s].
    """
    rules = FrankaRules(limits, T)
    rules.slowing = Slowing()
    return rules


class StandIn:
    """A robot that goes exactly where it is told.

    Args:
        graph: Where its topics are.
        limits: Of its joints, in the order of the forward_position_controller.
        q: Where it stands, (n,) [rad].
        rate: Updates a second [Hz].
        judge: Of what it is told.
        others: Further joints in its states, of a gripper.
        jitter: Of the stamps, to either side, as a share of the period.
    """

    def __init__(
        self,
        graph: Graph,
        limits: JointLimits,
        q: np.ndarray,
        rate: float,
        judge: Judge,
        *,
        others: Sequence[str] = (),
        jitter: float = 0.2,
    ) -> None:
        self.q = q
        self.commands = 0
        self.complaints: list[str] = []
        self.way = [q]
        self._graph = graph
        self._period = 1.0 / rate
        self._judge = judge
        self._random = random.Random(0)
        self._jitter = jitter
        self._joints = limits.joint_names
        self._names = [*limits.joint_names, *others]
        self._random.shuffle(self._names)
        self._command: np.ndarray | None = None  # newest
        graph.listen(COMMANDS, 'robot', self._on_command)
        graph.clock.repeat(self._period, self._update)

    def _on_command(self, message: Float64MultiArray) -> None:
        self._command = np.array(message.data)
        self.commands += 1

    def _update(self) -> None:
        """The state is published before commands are taken up, as the broadcaster comes first."""
        positions = dict(zip(self._joints, self.q.tolist(), strict=True))
        values = np.array([positions.get(name, 0.02) for name in self._names])
        delay = self._random.uniform(-self._jitter, self._jitter) * self._period
        stamp = EPOCH + round(1e9 * (self._graph.clock.now + delay))
        state: JointState = to_joint_state(stamp, self._names, values, np.zeros(len(values)))
        command = self._command
        if command is not None:
            assert command.shape == self.q.shape
            complaint = self._judge.verdict(command)
            if complaint:
                self.complaints.append(complaint)
            self.q = command
            self.way.append(command)
        self._graph.publish('joint_states', state)


@contextmanager
def behind_ros2_control(
    params_file: Path, description: str = ''
) -> Iterator[tuple[Graph, VirtualTime]]:
    """A controller and a planner with the parameters of a file, and wires for a robot.

    Args:
        params_file: As users pass it.
        description: What robot_state_publisher would publish; empty: nothing.
    """
    clock = VirtualTime()
    graph = Graph(clock)
    with own_domain(), mock.patch('time.monotonic', clock.monotonic):
        rclpy.init(args=['--ros-args', '--params-file', str(params_file)])
        nodes: list[Node] = []
        try:
            if description:
                graph.publish('robot_description', String(data=description), latched=True)
            nodes += [_wired(cls, graph)() for cls in (ControllerNode, PlannerNode)]
            yield graph, clock
        finally:
            for node in nodes:
                node.destroy_node()
            rclpy.shutdown()


def _wired(cls: type[Node], graph: Graph) -> type[Node]:
    """The node's class, on wires."""
    return type(cls.__name__, (cls, _Wired), {'graph': graph})
