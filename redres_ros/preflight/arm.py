"""Verdicts of the check, and those on joints, positions, limits and frames: whether the arm is the
expected one.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from redres_ros.errors import RedresError
from redres_ros.nodes.robot_parameters import DESCRIPTION, TOPIC
from redres_ros.preflight.graph_snapshot import FORWARD, STATES, TWISTS, GraphSnapshot, StateSeen
from redres_ros.robot_model import RobotModel
from redres_ros.robots import arm_from_urdf, choose_arm
from redres_ros.robots.joint_limits import JointLimits

_NEAR = 0.05  # of a range, from its end
_MOVING = 0.01  # [rad/s] or [m/s]
_SAME = 1e-3  # [rad] by which two sources of limits may differ


class Level(Enum):
    """How a verdict counts; only a fault makes the check fail."""

    OK = 'ok'
    NOTE = 'note'
    FAULT = 'FAULT'


class Verdict(NamedTuple):
    """A sentence on one subject."""

    level: Level
    subject: str
    text: str

    def __str__(self) -> str:
        return f'{self.level.value:<6} {self.subject:<11} {self.text}'


ok = partial(Verdict, Level.OK)
note = partial(Verdict, Level.NOTE)
fault = partial(Verdict, Level.FAULT)


@dataclass(frozen=True)
class ExpectedArm:
    """The arm and the rate that are expected, from the controller's parameters or from the user.

    Args:
        robot: Name, path, or topic.
        tip_frame: Empty: the arm's own.
        rate: States a second [Hz].
        margin: Kept from the ends of the ranges [rad].
    """

    robot: str
    tip_frame: str = ''
    rate: float = 500.0
    margin: float = 0.0


def judge_arm(seen: GraphSnapshot, expected: ExpectedArm) -> Iterator[Verdict]:
    """Checks joints, positions, limits and frames against the expected arm.

    Args:
        seen: What was received from the robot.
        expected: The arm that it should be.
    """
    try:
        model = _model_of(expected, seen.description)
    except RedresError as error:
        yield fault('arm', str(error))
        return
    limits = JointLimits.of(model.arm)
    yield from _judge_joints(seen.states, limits)
    yield from _judge_order(seen.forward_joints, limits.joint_names)
    yield from _judge_description(seen.description, expected, limits)
    yield from _judge_frames(seen, model)


def _model_of(expected: ExpectedArm, description: str) -> RobotModel:
    if expected.robot != TOPIC:
        return RobotModel(choose_arm(expected.robot, expected.tip_frame))
    if not description:
        raise RedresError(f'the arm comes from {DESCRIPTION}, which has no publisher')
    return RobotModel(arm_from_urdf(description, expected.tip_frame))


def _judge_joints(states: tuple[StateSeen, ...], limits: JointLimits) -> Iterator[Verdict]:
    ours = [state for state in states if set(limits.joint_names) & state.positions.keys()]
    if states and not ours:
        got = ', '.join(states[-1].positions)
        wanted = ', '.join(limits.joint_names)
        yield fault('joints', f'{STATES} holds {got}; expected {wanted}')
    if not ours:
        return
    positions = ours[-1].positions
    missing = [name for name in limits.joint_names if name not in positions]
    if missing:
        yield fault('joints', f'{STATES} lacks {", ".join(missing)}')
        return
    others = ', '.join(name for name in positions if name not in limits.joint_names)
    ignored = f'; ignored: {others}' if others else ''
    yield ok('joints', f'all {len(limits.joint_names)}{ignored}')
    q = np.array([positions[name] for name in limits.joint_names])
    yield from _judge_positions(q, limits)
    yield from _judge_standstill(ours, limits.joint_names)


def _judge_order(got: tuple[str, ...], expected: tuple[str, ...]) -> Iterator[Verdict]:
    """Commands for ros2_control are numbers without names: the order must be the arm's."""
    if got == expected:
        yield ok('order', f'{FORWARD} has the joints {", ".join(got)}')
    elif got:
        text = f'{FORWARD} has the joints {", ".join(got)}; expected {", ".join(expected)}'
        yield fault('order', text)


def _judge_positions(q: np.ndarray, limits: JointLimits) -> Iterator[Verdict]:
    if not np.isfinite(q).all():
        yield fault('positions', f'{q.tolist()}; every value must be finite')
        return
    margin = np.minimum(q - limits.lower, limits.upper - q) / (limits.upper - limits.lower)  # (n,)
    j = int(np.argmin(margin))
    where = f'{limits.joint_names[j]} is at {q[j]:.3f}'
    allowed = f'{limits.lower[j]:.3f} to {limits.upper[j]:.3f}'
    if margin[j] < 0.0:
        yield fault('positions', f'{where}; allowed: {allowed}')
    elif margin[j] < _NEAR:
        yield note('positions', f'{where}, near an end of its range {allowed}')
    else:
        yield ok('positions', 'inside all ranges')


def _judge_standstill(states: list[StateSeen], names: tuple[str, ...]) -> Iterator[Verdict]:
    first = states[0]
    last = states[-1]
    elapsed = (last.stamp - first.stamp) / 1e9  # [s]
    complete = all(name in first.positions for name in names)
    if elapsed <= 0.0 or not complete:
        return
    speeds = [abs(last.positions[name] - first.positions[name]) / elapsed for name in names]
    if max(speeds) > _MOVING:
        fastest = names[int(np.argmax(speeds))]
        yield note('standstill', f'the arm moves: {fastest} at {max(speeds):.3g}/s')


def _judge_description(
    description: str, expected: ExpectedArm, limits: JointLimits
) -> Iterator[Verdict]:
    """Whether the arm that is published allows less than the one that is expected."""
    if not description or expected.robot == TOPIC:
        return
    try:
        tip = expected.tip_frame or choose_arm(expected.robot).tip_frame
        published = JointLimits.of(arm_from_urdf(description, tip))
    except RedresError as error:
        yield note('limits', f'the URDF on {DESCRIPTION} is of another arm: {error}')
        return
    for j, name in enumerate(limits.joint_names):
        if name not in published.joint_names:
            continue
        i = published.joint_names.index(name)
        theirs = (published.lower[i], published.upper[i], published.velocity[i])
        ours = (limits.lower[j], limits.upper[j], limits.velocity[j])
        excess = (theirs[0] - ours[0], ours[1] - theirs[1])
        if max(*excess, ours[2] - theirs[2] + expected.margin) - expected.margin > _SAME:
            yield fault(
                'limits',
                f'{name}: {DESCRIPTION} allows {_range(theirs)}, the arm expected {_range(ours)}',
            )


def _range(limits: tuple[Any, ...]) -> str:
    lower, upper, velocity = limits
    return f'{lower:.3f} to {upper:.3f} at {velocity:.3f}/s'


def _judge_frames(seen: GraphSnapshot, model: RobotModel) -> Iterator[Verdict]:
    base = ''
    if seen.controller:
        base = seen.controller['base_frame']
    known = {'', base, model.base_frame}
    for frame in sorted(seen.twist_frames - known):
        try:
            model.pose(np.zeros(model.n), frame)
        except RedresError as error:
            yield fault('frames', f'{TWISTS} comes in an {error}')
            return
    tip = model.arm.tip_frame
    yield ok('frames', f'tip {tip}, base {base or model.base_frame}')
