"""A robot and a listener for tests: real nodes as real processes in a ROS domain of their own."""

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from geometry_msgs.msg import TwistStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

from redres_ros.nodes.conversions import to_joint_state, to_nanoseconds, to_twist
from redres_ros.nodes.graph import NodeProcess, own_domain
from redres_ros.nodes.runtime import spun
from redres_ros.robot_model import RobotModel
from redres_ros.tasks import load_task

PERIOD = 2_000_000  # [ns]
NAMES = RobotModel.named('lwr4_paper').joint_names
START = load_task('rectangle').start
PATIENCE = 20.0  # [s] for what must happen, on a machine that may stall


class Probe(Node):
    """Plays robot and planner to the controller, and keeps what it answers by the stamp that is answered."""

    def __init__(self) -> None:
        super().__init__('probe')
        self.stamp = 10**12
        self.answers: dict[int, JointState] = {}
        self.heard: dict[str, list[Any]] = {}
        self._states = self.create_publisher(JointState, 'joint_states', QoSProfile(depth=1))
        self._twists = self.create_publisher(TwistStamped, 'cartesian_velocity', QoSProfile(depth=1))
        self.create_subscription(JointState, 'joint_command', self._on_answer, QoSProfile(depth=1000))

    def listen(self, kind: type, topic: str, qos: QoSProfile | int = 100) -> list[Any]:
        """A list that grows by every message on a topic."""
        self.heard[topic] = []
        self.create_subscription(kind, topic, self.heard[topic].append, qos)
        return self.heard[topic]

    def send(self, message: JointState) -> None:
        """Publish a state as it is."""
        self._states.publish(message)

    def state(self, q: np.ndarray, names: tuple[str, ...] = NAMES) -> JointState:
        """The next state, one period after the last."""
        self.stamp += PERIOD
        return to_joint_state(self.stamp, names, np.asarray(q, dtype=float), np.zeros(len(q)))

    def ask(self, q: np.ndarray, names: tuple[str, ...] = NAMES) -> tuple[np.ndarray, np.ndarray]:
        """Send the next state until it is answered; q_ref and dq of the answer, both (n,)."""
        message = self.state(q, names)
        await_that(lambda: self._asked(message), f'an answer to the state of {self.stamp} ns', every=0.05)
        answer = self.answers[self.stamp]
        return np.array(answer.position), np.array(answer.velocity)

    def steer(self, dx: np.ndarray, frame: str = 'world', stamp: int | None = None) -> None:
        """Publish a task velocity, stamped as the last state unless told otherwise, and give it time to arrive."""
        self._twists.publish(to_twist(self.stamp if stamp is None else stamp, frame, np.asarray(dx, dtype=float)))
        time.sleep(0.05)

    def _asked(self, message: JointState) -> bool:
        self._states.publish(message)
        until = time.monotonic() + 0.2
        while self.stamp not in self.answers and time.monotonic() < until:
            time.sleep(0.0005)
        return self.stamp in self.answers

    def _on_answer(self, message: JointState) -> None:
        self.answers[to_nanoseconds(message.header.stamp)] = message


def await_that(condition: Callable[[], bool], what: str, every: float = 0.01) -> None:
    """Wait until a condition holds; fail if it does not in time."""
    until = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < until, f'waited {PATIENCE:g} s in vain for {what}'
        time.sleep(every)


@contextmanager
def nodes(directory: Path, **parameters: dict[str, Any]) -> Iterator[tuple[Probe, dict[str, NodeProcess]]]:
    """The named nodes with their parameters, and a probe, in a domain of their own."""
    with ExitStack() as stack:
        stack.enter_context(own_domain())
        probe = stack.enter_context(spun(Probe))
        processes = {name: NodeProcess(name, directory / f'{name}.log', values) for name, values in parameters.items()}
        for process in processes.values():
            stack.callback(process.end)
        yield probe, processes


def log_lines(directory: Path, name: str) -> list[str]:
    """What a node has printed."""
    return (directory / f'{name}.log').read_text().splitlines()


