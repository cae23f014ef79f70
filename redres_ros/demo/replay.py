"""A motion on the nodes' tapes as the same table that the ideal loop gives."""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from redres_ros.command import Command
from redres_ros.demo.tape import read_tape, stamped
from redres_ros.laws import Law
from redres_ros.nodes.conversions import JointOrder
from redres_ros.planner import Reference, orientation_error
from redres_ros.robot_model import RobotModel, RobotState
from redres_ros.rotation import from_quaternion
from redres_ros.simulation.recording import Recording, row
from redres_ros.task_run import RunState

V = TypeVar('V')

MOVING = RunState.MOVING.value  # the planner's word while a task is under way
FINISHED = RunState.FINISHED.value


@dataclass(frozen=True)
class Log:
    """What was said, by the stamp [ns] of the state that it belongs to.

    Attributes:
        states: q, (n,) [rad].
        commands: q_ref [rad] and dq [rad/s], (n,) each.
        desired: Position [m] and quaternion of the tip, (7,).
        segments: The segment of the task.
        words: Of the planner.
        laws: Name of the law in force.
        scalings: Share of the task velocity that the limits allow.
        reasons: Why the robot stopped itself; empty where it takes commands.
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
        """Stamps at which the planner had the task under way and the robot took commands, for each
        time that the task was begun.
        """
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
        """Desired poses at some stamps, (N, 7); interpolated where the planner missed one."""
        known = sorted(self.desired)
        poses = np.array([self.desired[stamp] for stamp in known])  # (N, 7)
        at = np.array(stamps) - known[0]
        of = np.array(known) - known[0]  # [ns], small enough for a float
        return np.column_stack([np.interp(at, of, column) for column in poses.T])

    def segment_at(self, stamp: int) -> int:
        """The segment that the task was on."""
        return _latest(self.segments, self._segment_stamps, stamp)

    def law_at(self, stamp: int) -> str:
        """Name of the law in force."""
        return _latest(self.laws, self._law_stamps, stamp)

    def switches(self) -> tuple[tuple[float, str, str], ...]:
        """Changes of the law while the task was under way: seconds since it began, name before,
        name after.
        """
        changes = []
        stamps = self.under_way()
        for before, after in pairwise(stamps):
            if self.law_at(before) != self.law_at(after):
                seconds = (after - stamps[0]) / 1e9
                changes.append((seconds, self.law_at(before), self.law_at(after)))
        return tuple(changes)

    def scaling_at(self, stamp: int) -> float:
        """The share of the task velocity that the limits allowed; it is told when it changes."""
        return _latest(self.scalings, self._scaling_stamps, stamp) if self.scalings else 1.0

    @cached_property
    def _scaling_stamps(self) -> list[int]:
        return sorted(self.scalings)

    @cached_property
    def _law_stamps(self) -> list[int]:
        return sorted(self.laws)

    @cached_property
    def _segment_stamps(self) -> list[int]:
        return sorted(self.segments)


def read_log(paths: Iterable[Path], joint_names: tuple[str, ...], until: float = math.inf) -> Log:
    """What is on the tapes of one run.

    Args:
        paths: of the tapes, one a process.
        joint_names: in the order in which positions and velocities are wanted.
        until: the last stamp that counts [ns].
    """
    joints = JointOrder(joint_names)
    converters: dict[str, Callable[[Any], Any]] = {
        'joint_states': joints.positions,
        'joint_command': lambda message: (joints.positions(message), np.array(message.velocity)),
        'planner/desired_pose': _pose,
        'planner/segment': _data,
        'planner/state': _data,
        'controller/law': _data,
        'controller/task_scaling': _data,
        'sim/stop_reason': _data,
    }
    log: dict[str, dict[int, Any]] = {topic: {} for topic in converters}
    session = []
    newest: dict[str, tuple[bytes, Any]] = {}  # data and value: many words are said every cycle
    for path in paths:
        for stamp, entry in stamped(read_tape(path), until):
            if entry.topic in converters:
                data, value = newest.get(entry.topic, (b'', None))
                if entry.data != data:
                    value = converters[entry.topic](entry.message)
                    newest[entry.topic] = (entry.data, value)
                log[entry.topic][stamp] = value
            elif entry.topic == 'sim/session_state':
                session.append(entry.message.data)
    return Log(
        states=log['joint_states'],
        commands=log['joint_command'],
        desired=log['planner/desired_pose'],
        segments=log['planner/segment'],
        words=log['planner/state'],
        laws=log['controller/law'],
        scalings=log['controller/task_scaling'],
        reasons=log['sim/stop_reason'],
        session=tuple(session),
    )


def replay(
    log: Log, model: RobotModel, make_law: Callable[[str], Law], T: float, pose: bool = False
) -> Recording:
    """The table of a run, from the stamp at which the task began.

    A state that the controller did not answer has no row. Norms of accelerations reach back to the
    last command, which is more than T ago where a cycle was missed.

    Args:
        log: of the run.
        model: of the arm.
        make_law: the law of a name, with the gains that it had.
        T: the sampling time [s].
        pose: whether the task has an orientation.
    """
    under_way = log.under_way()
    desired = {}
    if under_way:
        desired = dict(zip(under_way, log.desired_at(under_way), strict=True))
    rows = []
    dq_prev = np.zeros(model.n)
    stamp_prev = 0
    for stamp in sorted(log.states.keys() & log.commands.keys()):
        q_ref, dq = log.commands[stamp]
        if stamp in desired:
            state = model.state(log.states[stamp], dq_prev)
            elapsed = (stamp - stamp_prev) / 1e9 if stamp_prev else T
            J = state.J if pose else state.J[:3]
            command = Command(
                dq,
                q_ref,
                state,
                elapsed,
                J,
                make_law(log.law_at(stamp)).weight(state),
                s=log.scaling_at(stamp),
                limiting='',
                lost=np.zeros(len(J)),
            )
            reference = _reference(desired[stamp], state, log.segment_at(stamp), pose)
            rows.append(row((stamp - under_way[0]) / 1e9, command, reference))
        dq_prev = dq
        stamp_prev = stamp
    reason = log.reason
    return Recording.of(rows, model.n, T, log.finished and not reason, reason, pose)


def _latest(values: Mapping[int, V], stamps: list[int], stamp: int) -> V:
    """The value of the newest of the stamps up to one; the first value before all of them."""
    return values[stamps[max(bisect_right(stamps, stamp) - 1, 0)]]


def _reference(wanted: np.ndarray, state: RobotState, segment: int, pose: bool) -> Reference:
    """What the planner asked for, without the velocity, which is not needed here."""
    x_d = wanted[:3]
    reference = Reference(np.zeros(3), x_d, x_d - state.x, segment, finished=False)
    if not pose:
        return reference
    R_d = from_quaternion(wanted[3:])
    return replace(reference, R_d=R_d, orientation_error=orientation_error(R_d, state.R))


def _pose(message: Any) -> np.ndarray:
    x = message.pose.position
    turn = message.pose.orientation
    return np.array((x.x, x.y, x.z, turn.x, turn.y, turn.z, turn.w))


def _data(message: Any) -> Any:
    return message.data
