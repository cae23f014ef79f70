"""A robot and a listener for tests: real nodes as real processes in a ROS domain of their own."""

import os
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from itertools import pairwise
from operator import itemgetter
from pathlib import Path
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

import numpy as np
import yaml
from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

from redres_ros.demo.processes import NodeProcess
from redres_ros.graph.client import GraphClient
from redres_ros.nodes.conversions import to_joint_state, to_nanoseconds
from redres_ros.nodes.runtime import own_domain, spun
from redres_ros.nodes.topics import LATCHED, SESSION
from redres_ros.planning.waypoints import load_task
from redres_ros.robot_model import RobotModel
from redres_ros.robots import find_arm
from redres_ros.robots.joint_limits import JointLimits

PERIOD = 2_000_000  # [ns]

N = TypeVar('N', bound=Node)
State = tuple[int, np.ndarray]  # stamp [ns] and q (n,) [rad]

NAMES = RobotModel.named('lwr4_paper').joint_names
START = load_task('rectangle').start
# [rad] that a position may be off where a stream of commands begins anew: a servo's lag, and no
# more
JUMP = 0.02
SLOW = 1e-3  # [rad/s] of an arm at rest
PATIENCE = 60.0  # [s] for what must happen, where a process may take 20 s to start

_clients: WeakKeyDictionary[Node, GraphClient] = WeakKeyDictionary()


def client_of(node: Node) -> GraphClient:
    """A node's client, with the patience of tests: who is asked may not be there yet."""
    if node not in _clients:
        _clients[node] = GraphClient(node, PATIENCE)
    return _clients[node]


def call(node: Node, kind: type, service: str, request: Any) -> Any:
    return client_of(node).call(kind, service, request)


def read_parameters(node: Node, of: str) -> dict[str, Any]:
    return client_of(node).parameters(of)


class Probe(Node):
    """Plays robot and planner to the controller, and keeps its responses by the stamp
    of the state.
    """

    def __init__(self) -> None:
        super().__init__('probe')
        self.stamp = 10**12
        self.responses: dict[int, JointState] = {}
        self._states = self.create_publisher(JointState, 'joint_states', QoSProfile(depth=1))
        self.create_subscription(
            JointState, 'joint_command', self._on_response, QoSProfile(depth=1000)
        )

    def listen(self, kind: type, topic: str, qos: QoSProfile | int = 100) -> list[Any]:
        """A list that grows by every message on a topic."""
        received: list[Any] = []
        self.create_subscription(kind, topic, received.append, qos)
        return received

    def send(self, message: JointState) -> None:
        self._states.publish(message)

    def state(self, q: np.ndarray) -> JointState:
        """The next state, one period after the last."""
        self.stamp += PERIOD
        return to_joint_state(self.stamp, NAMES, q, np.zeros(len(q)))

    def ask(self, q: np.ndarray) -> None:
        """Send the next state until a response comes."""
        message = self.state(q)

        def asked() -> bool:
            self.send(message)
            return self.stamp in self.responses

        await_that(asked, f'a response to the state of {self.stamp} ns', every=0.05)

    def settle(self) -> None:
        """Wait until the controller has received all that was published: it responds in order."""
        call(self, GetParameters, 'controller/get_parameters', GetParameters.Request())

    def _on_response(self, message: JointState) -> None:
        self.responses[to_nanoseconds(message.header.stamp)] = message


class Observer(Node):
    """Records what robot and controller send each other, and checks it.

    `at`: stamp [ns] of the newest state; `session`: (stamp at which it was received, state).
    """

    def __init__(self) -> None:
        super().__init__('observer')
        self.at = 0
        self.states: list[State] = []  # in the order of arrival
        self.commands: list[tuple[int, np.ndarray, np.ndarray]] = []  # (stamp, q_ref, dq)
        self.session: list[tuple[int, str]] = []
        self.reasons: list[str] = []
        everything = QoSProfile(depth=50_000)
        self.create_subscription(JointState, 'joint_states', self._on_state, everything)
        self.create_subscription(JointState, 'joint_command', self._on_command, everything)
        self.create_subscription(String, SESSION, self._on_session, LATCHED)
        self.create_subscription(
            String, 'sim/stop_reason', lambda message: self.reasons.append(message.data), LATCHED
        )

    @property
    def commanding(self) -> bool:
        return bool(self.session) and self.session[-1][1] == 'CMD'

    @property
    def speed(self) -> float:
        """Largest joint speed between the two newest states [rad/s]; NaN before there are two."""
        newest = self.states[-2:]
        return speed(*newest) if len(newest) == 2 else np.nan

    def await_command_mode(self, beyond: int = 0) -> float:
        """Wait for command mode to begin after a stamp [ns]; how long after it that was on the
        robot's clock [s].
        """
        await_that(lambda: self.commanding and self.session[-1][0] >= beyond, 'command mode')
        return (self.session[-1][0] - beyond) / 1e9

    def await_standstill(self, beyond: int) -> float:
        """Wait for the arm to come to rest; how long after a stamp [ns] that was on the robot's
        clock [s].
        """

        def began() -> list[int]:
            """Stamps from which on the arm rests; the next one of a robot that waited may jump."""
            pairs = pairwise(self.states[-1000:])
            return [at for (at, q), now in pairs if at >= beyond and speed((at, q), now) < SLOW]

        await_that(lambda: bool(began()), 'standstill')
        return (began()[0] - beyond) / 1e9

    def reset(self) -> float:
        """Call sim/reset and wait for command mode; how long it took on the robot's clock [s]."""
        called = self.at
        assert call(self, Trigger, 'sim/reset', Trigger.Request()).success
        return self.await_command_mode(called)

    def assert_all_was_well(self) -> None:
        """The arm does not jump; references are judged in virtual time."""
        assert self.states and self.commands
        limits = JointLimits.of(find_arm('lwr4_paper'))
        for (before, q_before), (after, q_after) in pairwise(
            sorted(self.states, key=itemgetter(0))
        ):
            step = np.abs(q_after - q_before)
            assert (step <= limits.velocity * (after - before) / 1e9 + JUMP).all(), (
                f'{step} rad from {before} to {after} ns'
            )

    def _on_state(self, message: JointState) -> None:
        stamp = to_nanoseconds(message.header.stamp)
        if stamp != self.at:  # a robot that waits for a response asks again
            self.at = stamp
            self.states.append((stamp, np.array(message.position)))

    def _on_command(self, message: JointState) -> None:
        stamp = to_nanoseconds(message.header.stamp)
        self.commands.append((stamp, np.array(message.position), np.array(message.velocity)))

    def _on_session(self, message: String) -> None:
        self.session.append((self.at, message.data))


def speed(before: State, now: State) -> float:
    """Largest joint speed between two states [rad/s]."""
    return float(np.abs(now[1] - before[1]).max()) / ((now[0] - before[0]) / 1e9)


def await_that(
    condition: Callable[[], bool], what: str, every: float = 0.01, patience: float = PATIENCE
) -> None:
    """Wait until a condition holds; fail if it does not in time."""
    until = time.monotonic() + patience
    while not condition():
        assert time.monotonic() < until, f'waited {patience:g} s in vain for {what}'
        time.sleep(every)


def is_running(pid: int) -> bool:
    """Whether a process exists and is more than an entry that nobody has waited for."""
    try:
        return (Path('/proc') / str(pid) / 'stat').read_text().rpartition(')')[2].split()[0] != 'Z'
    except OSError:
        return False


@contextmanager
def graph(make: Callable[[], N]) -> Iterator[tuple[N, Callable[..., NodeProcess]]]:
    """A listener in a domain of its own, and what starts node processes that end with it."""
    with ExitStack() as stack:
        stack.enter_context(own_domain())
        listener = stack.enter_context(spun(make))

        def start(name: str, log: Path, **parameters: Any) -> NodeProcess:
            process = NodeProcess(name, log, parameters)
            stack.callback(process.end)
            return process

        yield listener, start


@contextmanager
def nodes(
    directory: Path, **parameters: dict[str, Any]
) -> Iterator[tuple[Probe, dict[str, NodeProcess]]]:
    """The named nodes with their parameters, and a probe, in a domain of their own."""
    with graph(Probe) as (probe, start):
        yield (
            probe,
            {
                name: start(name, directory / f'{name}.log', **values)
                for name, values in parameters.items()
            },
        )


def write_task(path: Path, waypoints: np.ndarray, segment_time: float) -> str:
    """A file for the paper's arm from its start, with waypoints (N, 3) [m]; its path."""
    content = {
        'robot': 'lwr4_paper',
        'start': np.degrees(START).tolist(),
        'segment_time': segment_time,
        'waypoints': waypoints.tolist(),
    }
    path.write_text(yaml.safe_dump(content))
    return str(path)


def log_lines(directory: Path, name: str) -> list[str]:
    return (directory / f'{name}.log').read_text().splitlines()


def udp_sockets(pid: int) -> list[list[str]]:
    """The lines of /proc/net/udp that belong to a process, each as its columns."""
    links = [os.readlink(path) for path in Path(f'/proc/{pid}/fd').iterdir() if path.is_symlink()]
    rows = [line.split() for line in Path('/proc/net/udp').read_text().splitlines()[1:]]
    return [row for row in rows if f'socket:[{row[9]}]' in links]
