"""The log of a run from the nodes' recordings, by the stamps of the robot's states."""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np

from redres_ros.graph.mcap_file import RecordedMessage, read_messages
from redres_ros.nodes.conversions import JointMapper
from redres_ros.nodes.topics import REASON, SESSION, TASK_STATE
from redres_ros.nodes.wire import stamp_of
from redres_ros.planning.task_executor import TaskState

# Full names of topics. What a run is judged by, the session's words apart:
STATES = '/joint_states'
COMMANDS = '/joint_command'
_DESIRED = '/planner/desired_pose'
_SEGMENT = '/planner/segment'
_TASK = f'/{TASK_STATE}'
_LAW = '/controller/law'
_SCALING = '/controller/task_scaling'
_REASON = f'/{REASON}'
_SESSION = f'/{SESSION}'

_TWISTS = '/cartesian_velocity'  # whose stamps belong to what the planner says beside it
_FORCES = '/wrench'  # published while a controller listens
_STAMPED = {STATES, COMMANDS, _TWISTS, _DESIRED, _FORCES}
_FIELDS = {
    'states': STATES,
    'commands': COMMANDS,
    'desired': _DESIRED,
    'segments': _SEGMENT,
    'words': _TASK,
    'laws': _LAW,
    'scalings': _SCALING,
    'reasons': _REASON,
    'forces': _FORCES,
}  # of a log
# As nodes name them.
JUDGED = tuple(topic.removeprefix('/') for topic in (*_FIELDS.values(), _TWISTS, _SESSION))

MOVING = TaskState.MOVING.value  # the planner's word while a task is under way
FINISHED = TaskState.FINISHED.value

_DISORDER = 1e9  # [ns] by which a stamp may come before a smaller one, where faults are injected


@dataclass(frozen=True)
class Log:
    """Messages by the stamp [ns] of their state.

    Attributes:
        states: q, (n,) [rad].
        commands: q_ref [rad] and dq [rad/s], (n,) each.
        desired: Position [m] and quaternion of the tip, (7,).
        segments: The segment of the task.
        words: States of the planner's task.
        laws: Name of the law in force.
        scalings: Fraction of the task velocity that the limits allow.
        reasons: Why the robot stopped itself; empty if it takes commands.
        forces: Forces of the environment on the tip, (3,) [N].
        session: States of the robot's session, one after the other.
    """

    states: Mapping[int, np.ndarray]
    commands: Mapping[int, tuple[np.ndarray, np.ndarray]]
    desired: Mapping[int, np.ndarray]
    segments: Mapping[int, int]
    words: Mapping[int, str]
    laws: Mapping[int, str]
    scalings: Mapping[int, float]
    reasons: Mapping[int, str]
    forces: Mapping[int, np.ndarray]
    session: tuple[str, ...]

    @property
    def stopped_at(self) -> int | None:
        """Stamp of the last state before the robot stopped itself; None if it did not."""
        return min((stamp for stamp, reason in self.reasons.items() if reason), default=None)

    @property
    def reason(self) -> str:
        """Why the robot stopped itself; empty if it did not."""
        return '' if self.stopped_at is None else self.reasons[self.stopped_at]

    @property
    def finished(self) -> bool:
        """Whether the last point was reached, the last time if there were several."""
        return bool(self.words) and self.words[max(self.words)] == FINISHED

    def rounds(self) -> list[list[int]]:
        """Stamps of each round: the planner had the task under way, and the robot took commands."""
        rounds: list[list[int]] = []
        word = ''
        for stamp in sorted(self.desired.keys() | self.words.keys()):
            before = word
            word = self.words.get(stamp, word)
            if word == MOVING and before != MOVING:
                rounds.append([])
            stopped = self.stopped_at is not None and stamp > self.stopped_at
            if word == MOVING and stamp in self.desired and not stopped:
                rounds[-1].append(stamp)
        return [stamps for stamps in rounds if stamps]

    def under_way(self) -> list[int]:
        """Stamps of the states meanwhile, those that the planner missed included."""
        states = sorted(self.states)
        under_way = []
        for planned in self.rounds():
            first = bisect_left(states, planned[0])
            under_way += states[first : bisect_right(states, planned[-1])]
        return under_way

    def desired_at(self, stamps: list[int]) -> np.ndarray:
        """Desired poses at some stamps, (N, 7); interpolated if the planner missed one."""
        known = sorted(self.desired)
        poses = np.array([self.desired[stamp] for stamp in known])  # (N, 7)
        at = np.array(stamps) - known[0]
        of = np.array(known) - known[0]  # [ns], small enough for a float
        return np.column_stack([np.interp(at, of, column) for column in poses.T])

    def segment_at(self, stamp: int) -> int:
        """The segment that the task was on."""
        return int(self._latest('segments', stamp))

    def law_at(self, stamp: int) -> str:
        """Name of the law in force."""
        return str(self._latest('laws', stamp))

    def switches(self) -> tuple[tuple[float, str, str], ...]:
        """Changes of the law under way: seconds since the task began, name before, name after."""
        changes = []
        stamps = self.under_way()
        for before, after in pairwise(stamps):
            if self.law_at(before) != self.law_at(after):
                seconds = (after - stamps[0]) / 1e9
                changes.append((seconds, self.law_at(before), self.law_at(after)))
        return tuple(changes)

    def scaling_at(self, stamp: int) -> float:
        """The task scaling that the limits allowed; it is published when it changes."""
        return float(self._latest('scalings', stamp)) if self.scalings else 1.0

    def _latest(self, name: str, stamp: int) -> Any:
        """A field's value at its newest stamp up to this one; before all, the first."""
        stamps = self._stamps[name]
        return getattr(self, name)[stamps[max(bisect_right(stamps, stamp) - 1, 0)]]

    @cached_property
    def _stamps(self) -> dict[str, list[int]]:
        return {name: sorted(getattr(self, name)) for name in ('segments', 'laws', 'scalings')}


def read_log(paths: Iterable[Path], joint_names: tuple[str, ...], until: float = math.inf) -> Log:
    """The log of one run.

    Args:
        paths: Paths of the recordings, one a process.
        joint_names: In the order in which positions and velocities are wanted.
        until: The last stamp that counts [ns].
    """
    converters = _converters(JointMapper(joint_names))
    values: dict[str, dict[int, Any]] = {topic: {} for topic in converters}
    newest: dict[str, tuple[bytes, Any]] = {}  # data and value: many repeat in every cycle
    session = []
    for path in paths:
        for stamp, message in stamped(read_messages(path), until):
            topic = message.topic
            if topic == _SESSION:
                session.append(message.content.data)
            if topic not in converters:
                continue
            data, value = newest.get(topic, (b'', None))
            if message.data != data:
                value = converters[topic](message.content)
                newest[topic] = (message.data, value)
            values[topic][stamp] = value
    fields = {name: values[topic] for name, topic in _FIELDS.items()}
    return Log(**fields, session=tuple(session))


def _converters(joints: JointMapper) -> dict[str, Callable[[Any], Any]]:
    """What a log holds of a message, by topic."""
    return {
        **dict.fromkeys(_FIELDS.values(), attrgetter('data')),
        STATES: joints.positions,
        COMMANDS: lambda message: (joints.positions(message), np.array(message.velocity)),
        _DESIRED: _pose,
        _FORCES: _force,
    }


def stamped(
    messages: Iterable[RecordedMessage], until: float = math.inf
) -> Iterator[tuple[int, RecordedMessage]]:
    """Messages with their stamps [ns]. One that has none belongs to the newest stamp before it: a
    node publishes it in the same callback. 0 before the first.

    Args:
        messages: Messages of one recording.
        until: The last stamp that counts. A demo with a page goes on long after it.
    """
    newest = 0
    for message in messages:
        if message.topic in _STAMPED:
            newest = stamp_of(message.data) or newest  # an operator's twists have none
        if newest > until + _DISORDER:
            return
        if newest <= until:
            yield newest, message


def _pose(message: Any) -> np.ndarray:
    x = message.pose.position
    turn = message.pose.orientation
    return np.array((x.x, x.y, x.z, turn.x, turn.y, turn.z, turn.w))


def _force(message: Any) -> np.ndarray:
    force = message.wrench.force
    return np.array((force.x, force.y, force.z))
