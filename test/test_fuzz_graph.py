"""Random messages and parameter sets into a graph at work, in virtual time, while laws, limits and
preferences are switched: some thousands, and a hundred thousand with REDRES_NIGHTLY=1.
"""

from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, TwistStamped
from nightly import NIGHTLY
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, String
from virtual_graph import VirtualRun, virtual_run

from redres_ros.laws import LAWS
from redres_ros.nodes.conversions import stacked, to_joint_state, to_pose, to_time, to_twist
from redres_ros.preferences import PREFERENCES
from redres_ros.robots import find_arm
from redres_ros.robots.joint_limits import JointLimits
from redres_ros.tasks import TASKS

pytestmark = pytest.mark.slow

MESSAGES = 100_000 if NIGHTLY else 4000
RATE = 100.0  # [Hz]
LIMITS = JointLimits.of(find_arm('lwr4_paper'))
ODD = (np.nan, np.inf, -np.inf, 1e300, -1e-300, 0.0)
STAMPS = (Time(sec=-(2**31)), Time(sec=-1), Time(sec=2**31 - 1, nanosec=2**32 - 1))
BOX = ['position', 'velocity', 'acceleration']
THROWN = 'thrown'  # in the place of a frame
WORDS = ('CMD', 'MON', 'MOVE', '', 'x' * 1000, 'cmd')


class Thrower:
    """Sends random messages to the graph."""

    def __init__(self, run: VirtualRun, seed: int) -> None:
        self._run = run
        self._chance = np.random.default_rng(seed)
        self.thrown: Counter[str] = Counter()
        self._throws: dict[str, Callable[[], None]] = {
            'joint_states': lambda: self._publish('joint_states', self._joints()),
            'joint_command': lambda: self._publish('joint_command', self._joints()),
            'cartesian_velocity': lambda: self._publish('cartesian_velocity', self._twist()),
            'target_pose': lambda: self._publish('target_pose', self._pose()),
            'session_state': lambda: self._publish('sim/session_state', self._word()),
            'stop_reason': lambda: self._publish('sim/stop_reason', self._word()),
            'task_scaling': lambda: self._publish('controller/task_scaling', self._number()),
            'parameters': self._set,
            'service': self._call,
        }

    def throw(self) -> None:
        kind = self._chance.choice(list(self._throws))
        self.thrown[str(kind)] += 1
        self._throws[str(kind)]()

    def _publish(self, topic: str, message: Any) -> None:
        self._run.graph.publish(topic, message)

    def _stamp(self) -> Time:
        """Around now, anywhere, or beyond what a clock can show."""
        if self._chance.random() < 0.1:
            return STAMPS[self._chance.integers(len(STAMPS))]
        newest = self._run.nodes['controller']._loop._cycles.newest
        near = newest + int(self._chance.integers(-20, 20)) * int(1e9 / RATE)
        anywhere = int(self._chance.integers(0, 2**31)) * 10**9
        return to_time(max(near if self._chance.random() < 0.8 else anywhere, 0))

    def _joints(self) -> JointState:
        q = self._chance.uniform(LIMITS.lower, LIMITS.upper)
        if self._chance.random() < 0.3:
            q[self._chance.integers(7)] = self._chance.choice(ODD[:3])
        order = self._chance.permutation(7)
        names = [LIMITS.joint_names[joint] for joint in order]
        q = q[order]
        if self._chance.random() < 0.3:
            names[self._chance.integers(7)] = str(self._chance.choice(('x', '', 'ä', names[0])))
        counts = [7, 7, 7]
        if self._chance.random() < 0.3:
            counts[self._chance.integers(3)] = int(self._chance.integers(7))
        message = to_joint_state(0, names[: counts[0]], q[: counts[1]], q[: counts[2]])
        message.header.stamp = self._stamp()
        message.header.frame_id = THROWN
        return message

    def _twist(self) -> TwistStamped:
        dx = self._chance.normal(0.0, 1.0, 3) * 10.0 ** self._chance.integers(-3, 3)
        if self._chance.random() < 0.3:
            dx[self._chance.integers(3)] = self._chance.choice(ODD)
        frame = str(self._chance.choice(('world', '', 'tool0', 'nose')))
        message = to_twist(0, frame, dx)
        if self._chance.random() < 0.7:
            message.header.stamp = self._stamp()
        return message

    def _pose(self) -> PoseStamped:
        x = self._chance.normal(0.0, 0.5, 3) * 10.0 ** self._chance.integers(-2, 4)
        if self._chance.random() < 0.3:
            x[self._chance.integers(3)] = self._chance.choice(ODD)
        return to_pose(0, str(self._chance.choice(('world', '', 'nose'))), x, np.eye(3))

    def _word(self) -> String:
        return String(data=str(self._chance.choice(WORDS)))

    def _number(self) -> Float64:
        return Float64(data=float(self._chance.choice((*ODD, 1.0, 0.5, -1.0))))

    def _set(self) -> None:
        gains = {
            'law': str(self._chance.choice(list(LAWS))),
            'damping': float(self._chance.uniform(0.0, RATE)),
            'limits': [*BOX, 'torque'][: 3 + self._chance.integers(2)],
            'limit_scale': float(self._chance.uniform(0.1, 1.0)),
            'preferences': [str(self._chance.choice([*PREFERENCES, 'none']))],
            'secondary_tasks': [str(self._chance.choice([*TASKS, 'none', 'none']))],
            'posture.gain': float(self._chance.uniform(0.0, 100.0)),
            'switch_time': float(self._chance.uniform(0.0, 1.0)),
            'command_timeout': float(self._chance.uniform(0.01, 1.0)),
        }
        names = self._chance.choice(list(gains), 3, replace=False)
        changes = [Parameter(str(name), value=gains[str(name)]) for name in names]
        self._run.nodes['controller'].set_parameters_atomically(changes)

    def _call(self) -> None:
        name = str(self._chance.choice(('planner/start', 'planner/stop', 'sim/reset', 'hold')))
        if name == 'hold':
            self._run.graph.call('controller/hold', data=bool(self._chance.random() < 0.2))
        else:
            self._run.graph.call(name)


class Observer:
    """Judges every command of the controller, and every task velocity of the planner."""

    def __init__(self, run: VirtualRun) -> None:
        self.commands = 0
        self.twists = 0
        self._dq = np.zeros(7)
        run.graph.listen('joint_command', 'observer', self._on_command)
        publisher = run.nodes['planner']._twist_publisher
        self._publish_twist = publisher.publish
        publisher.publish = self._on_twist

    def _on_command(self, message: JointState) -> None:
        if message.header.frame_id == THROWN:
            return
        self.commands += 1
        q_ref = np.array(message.position)
        dq = np.array(message.velocity)
        assert (np.abs(dq) <= LIMITS.velocity * (1.0 + 1e-9)).all()
        assert ((LIMITS.lower <= q_ref) & (q_ref <= LIMITS.upper)).all()
        step = LIMITS.acceleration / RATE * (1.0 + 1e-6)
        from_rest = (np.abs(dq) <= step).all()  # as after every new beginning
        assert from_rest or (np.abs(dq - self._dq) <= step).all()
        self._dq = dq

    def _on_twist(self, message: TwistStamped) -> None:
        # The rectangle's sides take 3 s: 15/8 of the mean speed, and the feedback's limit.
        assert np.linalg.norm(stacked(message.twist.linear, message.twist.angular)) < 2.0
        self.twists += 1
        self._publish_twist(message)


def test_whatever_is_thrown_no_command_leaves_the_limits_and_the_graph_goes_on() -> None:
    with virtual_run(RATE, planner={'autostart': True}) as run:
        observer = Observer(run)
        thrower = Thrower(run, seed=0)
        chance = np.random.default_rng(1)
        while thrower.thrown.total() < MESSAGES:
            calm = chance.random() < 0.01  # for the robot to begin its command mode anew
            run.run(1.0 if calm else float(chance.exponential(1.0)) / RATE)
            for _ in range(chance.integers(1, 6)):
                thrower.throw()
        assert observer.commands > MESSAGES / 10
        assert observer.twists > MESSAGES / 40
        references = np.array(run.references)
        speeds = np.abs(np.diff(references, axis=0)) * RATE
        assert (speeds <= LIMITS.velocity * (1.0 + 1e-9)).all()
        assert ((LIMITS.lower <= references) & (references <= LIMITS.upper)).all()
        assert all(run.nodes[name]._health() for name in run.nodes)
        run.graph.call('controller/hold', data=False)
        run.graph.call('planner/stop')
        run.graph.call('sim/reset')
        run.graph.publish('sim/stop_reason', String(data=''))
        assert run.run_until(lambda: run.commanding, 5.0)
        assert run.graph.call('planner/start').success
        run.run(1.0)
        assert np.ptp(run.references[-20:], axis=0).max() > 1e-3


VALUES = (
    *(np.nan, np.inf, -np.inf, -1.0, 0.0, 1e-300, 0.1, 5.0, 1e300),
    *(-(2**63), -1, 0, 1, 2**63 - 1, True, False),
    *('', 'none', 'x', '\n', 'position', 'minimum_torque', 'command', 'base'),
    *([np.nan], [1.0], [0.0] * 3, [1e9] * 3, [-1.0] * 6, [1.0] * 7, [0.1] * 100, [1], [True]),
    *(['none'], ['x'], ['position', 'position'], ['velocity', 'acceleration', 'torque']),
)


def test_each_parameter_is_either_set_to_an_allowed_value_or_refused_with_a_reason() -> None:
    with virtual_run() as run:
        for node in run.nodes.values():
            for name, kept in sorted(node._parameters.items()):
                for value in VALUES:
                    [result] = node.set_parameters([Parameter(name, value=value)])
                    if result.successful:
                        assert_allowed(node.describe_parameter(name), value)
                        assert node.set_parameters([kept])[0].successful
                    assert result.successful or result.reason
                    assert node._parameters[name] == kept


def assert_allowed(descriptor: Any, value: Any) -> None:
    """That a parameter may have this value, by its description."""
    assert not descriptor.read_only
    for limits in (*descriptor.floating_point_range, *descriptor.integer_range):
        assert limits.from_value <= value <= limits.to_value
    if descriptor.additional_constraints:
        words = [value] if isinstance(value, str) else value
        assert all(word in descriptor.additional_constraints for word in words)
