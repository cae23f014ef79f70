"""The messages of a demo's nodes by the stamps of the robot's states, and its motion."""

from bisect import bisect_right
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Int32, String

from redres_ros.command import Command
from redres_ros.geometry import from_quaternion
from redres_ros.graph.monitor import Sample, Sampler
from redres_ros.kernels.tick import rotation_error
from redres_ros.laws import Law
from redres_ros.nodes.conversions import JointMapper, deserialised, stacked, to_nanoseconds
from redres_ros.nodes.topics import REASON, SESSION, TASK_BEGUN, TASK_STATE
from redres_ros.planning.planner import Reference
from redres_ros.planning.task_executor import UNDER_WAY, TaskState
from redres_ros.resolution import Solution
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.recording import MotionRecorder, Recording

STATES = 'joint_states'
COMMANDS = 'joint_command'
DESIRED = 'planner/desired_pose'
FORCES = 'wrench'
SEGMENT = 'planner/segment'
LAW = 'controller/law'
SCALING = 'controller/task_scaling'


def _to_command(message: JointState, joints: JointMapper) -> tuple[np.ndarray, np.ndarray]:
    return joints.in_order(message, 'position'), joints.in_order(message, 'velocity')


def _to_pose(message: PoseStamped, _: JointMapper) -> np.ndarray:
    x = message.pose.position
    turn = message.pose.orientation
    return np.array((x.x, x.y, x.z, turn.x, turn.y, turn.z, turn.w))


# With what is kept of a message.
_STAMPED: dict[str, tuple[type, Callable[[Any, JointMapper], Any]]] = {
    STATES: (JointState, lambda message, joints: joints.in_order(message, 'position')),
    COMMANDS: (JointState, _to_command),
    DESIRED: (PoseStamped, _to_pose),
    FORCES: (WrenchStamped, lambda given, _: stacked(given.wrench.force, given.wrench.torque)[:3]),
}
# Without stamps; what the node publishes in the same callback, and before it, gives them one.
_UNSTAMPED: dict[str, tuple[type, str]] = {
    SEGMENT: (Int32, DESIRED),
    TASK_STATE: (String, DESIRED),
    LAW: (String, COMMANDS),
    SCALING: (Float64, COMMANDS),
    REASON: (String, STATES),
    SESSION: (String, STATES),
}
# Best effort: an observer must not delay the nodes. Deep enough for some seconds without a look.
_DEEP = QoSProfile(depth=20_000, reliability=ReliabilityPolicy.BEST_EFFORT)
_LATCHED = (TASK_BEGUN, TASK_STATE, REASON, SESSION)
_DEEP_LATCHED = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_MOVING = [state.value for state in UNDER_WAY]


class Log:
    """What was published of one run, by the stamp [ns] of the robot's state: measured positions,
    commands as q_ref [rad] and dq [rad/s], desired position [m] and quaternion of the tip (7,), and
    forces of the environment on it (3,) [N].
    """

    def __init__(self, joint_names: Sequence[str]) -> None:
        self._kept: dict[str, dict[int, Any]] = {topic: {} for topic in _STAMPED}
        self.states, self.commands, self.desired, self.forces = self._kept.values()
        # When a stamped message was published [ns], by topic and stamp
        self.sent: dict[str, dict[int, int]] = {topic: {} for topic in _STAMPED}
        self.newest = 0  # stamp of the newest state
        self.began = 0  # stamp at which the task began
        self._began_at = 0  # when that was published [ns]
        topics = {**_STAMPED, **_UNSTAMPED}.items()
        self._topics: dict[str, type] = {TASK_BEGUN: Time} | {name: of[0] for name, of in topics}
        self._joints = JointMapper(joint_names)
        self._changes: dict[str, list[tuple[int, Any]]] = {topic: [] for topic in _UNSTAMPED}
        self._last_data: dict[str, bytes] = {}  # of topics without stamps

    def collect(self, samples: Sampler) -> None:
        """Take what has come; the topics are subscribed to by the first call."""
        for topic, kind in self._topics.items():
            samples.add(topic, kind, _DEEP_LATCHED if topic in _LATCHED else _DEEP)
            for sample in samples.take(topic):
                self.enter(topic, sample)

    def close(self, samples: Sampler) -> None:
        """Unsubscribe: messages on demand cost the nodes time."""
        for topic in self._topics:
            samples.remove(topic)

    def enter(self, topic: str, sample: Sample) -> None:
        """Enter a message; of those without a stamp, the changes."""
        if topic == TASK_BEGUN:
            self.began = to_nanoseconds(deserialised(sample.data, Time))
            self._began_at = sample.sent
        elif topic in _STAMPED:
            kind, kept = _STAMPED[topic]
            message = deserialised(sample.data, kind)
            stamp = to_nanoseconds(message.header.stamp)
            if topic == STATES:
                self.newest = stamp
            self.sent[topic].setdefault(stamp, sample.sent)  # a robot that waits repeats a state
            self._kept[topic][stamp] = kept(message, self._joints)
        elif self._last_data.get(topic) != sample.data:
            self._last_data[topic] = sample.data
            value = deserialised(sample.data, self._topics[topic]).data
            self._changes[topic].append((sample.sent, value))

    def words(self, topic: str) -> tuple[str, ...]:
        """What was published on a topic of text, in order."""
        return tuple(value for _, value in self._changes[topic])

    def ending(self) -> str:
        """The planner's word for the end of the task that began last; empty before that."""
        words = [word for sent, word in self._changes[TASK_STATE] if sent >= self._began_at]
        return words[-1] if words and words[-1] not in _MOVING else ''

    def changes(self, topic: str) -> dict[int, Any]:
        """The values of a topic without stamps, by the stamp at which each was new; 0: before."""
        clock = self.sent[_UNSTAMPED[topic][1]]
        stamps = [0, *clock]
        times = list(clock.values())
        return {stamps[bisect_right(times, sent)]: value for sent, value in self._changes[topic]}

    def values_at(self, topic: str, stamps: Sequence[int], default: Any) -> list[Any]:
        """The values of a topic without stamps at some stamps; before all, the first one."""
        changes = self.changes(topic)
        if not changes:
            return [default] * len(stamps)
        known = sorted(changes)
        return [changes[known[max(bisect_right(known, stamp) - 1, 0)]] for stamp in stamps]

    def stopped(self) -> tuple[float, str]:
        """Stamp at which the robot stopped itself, and why; infinite and empty if it did not."""
        reasons = self.changes(REASON).items()
        return min((item for item in reasons if item[1]), default=(np.inf, ''))

    def under_way(self) -> list[int]:
        """Stamps of states in command mode while the planner moved, those it missed included."""
        if not self.desired:
            return []
        first = min(self.desired)
        last = min(max(self.desired), self.stopped()[0])
        states = sorted(self.states)
        words = self.values_at(TASK_STATE, states, '')
        return [
            stamp
            for stamp, word in zip(states, words, strict=True)
            if word == TaskState.MOVING.value and first <= stamp <= last
        ]

    def desired_at(self, stamps: Sequence[int]) -> np.ndarray:
        """Desired poses at some stamps, (N, 7); interpolated if the planner missed one."""
        if not stamps:
            return np.empty((0, 7))
        known = sorted(self.desired)
        poses = np.array([self.desired[stamp] for stamp in known])  # (N, 7)
        at = np.array(stamps) - known[0]
        of = np.array(known) - known[0]  # [ns], small enough for a float
        return np.column_stack([np.interp(at, of, column) for column in poses.T])


def replay(
    log: Log, model: RobotModel, make_law: Callable[[str], Law], T: float, pose: bool = False
) -> Recording:
    """The table of a run with laws of these gains, from the stamp at which the task began.

    A state without a command has no row, nor has one before which none was seen. Norms of
    accelerations reach back to the last command, more than T ago where a cycle was missed.
    """
    recorder = MotionRecorder(model, T, pose)
    stamps = log.under_way()
    known = sorted(log.states.keys() & log.commands.keys())
    before = {later: earlier for earlier, later in pairwise(known)}
    first = min(log.states, default=0)  # finds the arm at rest
    columns = zip(
        stamps,
        log.desired_at(stamps),
        log.values_at(LAW, stamps, ''),
        log.values_at(SCALING, stamps, 1.0),
        log.values_at(SEGMENT, stamps, 0),
        strict=True,
    )
    for stamp, desired, law, s, segment in columns:
        if stamp not in log.commands or (stamp not in before and stamp > first):
            continue
        q_ref, dq = log.commands[stamp]
        elapsed = (stamp - before[stamp]) / 1e9 if stamp in before else T
        dq_prev = log.commands[before[stamp]][1] if stamp in before else np.zeros(model.n)
        state = model.state(log.states[stamp], dq_prev)
        J = state.J if pose else state.J[:3]
        solution = Solution(dq, J, J.dot(dq), W=make_law(law).weight(state), s=s)
        command = Command(solution, q_ref, state, elapsed)
        x_d = desired[:3]
        reference = Reference(np.zeros(3), x_d, x_d - state.x, segment, finished=False)
        if pose:
            error = rotation_error(state.R, from_quaternion(desired[3:]))
            reference = reference._replace(orientation_error=error)
        recorder.add((stamp - stamps[0]) / 1e9, command, reference, s)
    _, reason = log.stopped()
    is_finished = log.ending() == TaskState.FINISHED.value and not reason
    return recorder.recording(reason, finished=is_finished)
