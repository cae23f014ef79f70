"""What is missing before a connected arm may move: a verdict on each part of a snapshot."""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from redres_ros.command import ROBOT_INTERFACES
from redres_ros.errors import RedresError
from redres_ros.loop.cycle_counter import NANOSECONDS, are_of_two
from redres_ros.loop.modes import COMMANDING
from redres_ros.nodes.robot_parameters import DESCRIPTION, TOPIC, make_arm
from redres_ros.nodes.topics import MODE, REASON, SESSION
from redres_ros.preflight.snapshot import (
    COMMANDS,
    CONTROLLER,
    FORWARD,
    STATES,
    TWISTS,
    GraphSnapshot,
    StateSeen,
)
from redres_ros.robot_model import RobotModel
from redres_ros.robots.joint_limits import JointLimits

# Levels of verdicts.
OK = 'ok'
NOTE = 'note'
FAULT = 'FAULT'

_FEWEST = 10  # states for an estimate of the rate
_RATE_ERROR = 0.02  # fraction by which the rate may differ
_NECESSARY = ('position', 'velocity', 'acceleration')  # limits of a real arm
_CAREFUL = 0.5  # limit_scale above which a note says so


class _Verdict(NamedTuple):
    """A sentence on one subject."""

    level: str  # only a fault makes the check fail
    subject: str
    text: str

    def __str__(self) -> str:
        return f'{self.level:<6} {self.subject:<11} {self.text}'


_Verdicts = Iterator[_Verdict]
_ok = partial(_Verdict, OK)
_note = partial(_Verdict, NOTE)
_fault = partial(_Verdict, FAULT)


class ExpectedArm(NamedTuple):
    """The arm and the rate that are expected, from the controller's parameters or from the user."""

    robot: str  # name, path, or topic
    tip_frame: str = ''  # empty: the arm's own
    rate: float = 500.0  # [Hz]


def judge(seen: GraphSnapshot, expected: ExpectedArm | None) -> list[_Verdict]:
    """All verdicts, the robot's first; what is expected matters if no controller runs."""
    if seen.controller:
        parameters = seen.controller
        expected = ExpectedArm(*(parameters[name] for name in ('robot', 'tip_frame', 'rate')))
    verdicts = [*_judge_states(seen), *_judge_session(seen)]
    if expected is None:
        text = 'no controller runs and no --robot is named: joints and limits are not known'
        verdicts.append(_fault('arm', text))
    else:
        verdicts += _judge_arm(seen, expected)
    return [*verdicts, *_judge_controller(seen), *_judge_commands(seen), *_judge_twists(seen)]


def _judge_states(seen: GraphSnapshot) -> _Verdicts:
    publishers = seen.publishers.get(STATES, ())
    names = ', '.join(publishers)
    if not publishers:
        yield _fault('states', f'{STATES} has no publisher in this ROS domain')
    elif not seen.states:
        yield _fault('states', f'{names} publishes {STATES}, but none came; is the robot running?')
    elif len(publishers) > 1:
        text = f'{names} publish {STATES}; only one may publish the joints of the arm'
        yield _note('states', text)
    else:
        yield _ok('states', f'from {names}')


def _judge_session(seen: GraphSnapshot) -> _Verdicts:
    reason = seen.words.get(REASON, '')
    session = seen.words.get(SESSION, '')
    if reason:
        yield _fault('session', f'the robot has stopped: {reason}')
    elif session and session not in COMMANDING:
        yield _note('session', f'the robot takes no commands yet: {session}')
    elif session:
        yield _ok('session', session)


def _judge_stamps(states: list[StateSeen], rate: float, publishers: Sequence[str]) -> _Verdicts:
    """Whether the states of the arm come in order at the expected rate [Hz]."""
    if not states:
        return
    stamps = np.array([state.stamp for state in states]) / 1e9  # [s]
    if not stamps.all():
        yield _fault('stamps', f'{STATES} without a stamp')
        return
    stamps = np.unique(stamps)  # a robot that waits for its response sends a state again
    if len(stamps) < _FEWEST:
        yield _fault('rate', f'only {len(stamps)} states came; too few to estimate the rate')
        return
    if are_of_two([state.stamp for state in states], round(NANOSECONDS / rate)):
        names = ', '.join(publishers)
        yield _fault('states', f'the joints of the arm come twice, from {names}; only one may')
        return
    period = float(np.median(np.diff(stamps)))  # [s]
    text = f'{1.0 / period:.4g} states a second'
    if abs(period * rate - 1.0) > _RATE_ERROR:
        yield _fault('rate', f'{text}; expected {rate:g}: change the parameter rate')
    else:
        yield _ok('rate', text)


def _judge_arm(seen: GraphSnapshot, expected: ExpectedArm) -> _Verdicts:
    """Verdicts on joints, positions, limits and frames: whether the arm is the expected one."""
    if expected.robot == TOPIC and not seen.description:
        yield _fault('arm', f'the arm comes from {DESCRIPTION}, which has no publisher')
        return
    try:
        arm = make_arm(expected.robot, expected.tip_frame, lambda: seen.description)
        model = RobotModel(arm)
    except RedresError as error:
        yield _fault('arm', str(error))
        return
    limits = JointLimits.of(arm)
    names = ', '.join(limits.joint_names)
    ours = [state for state in seen.states if set(limits.joint_names) & state.positions.keys()]
    yield from _judge_stamps(ours, expected.rate, seen.publishers.get(STATES, ()))
    if seen.states:
        yield from _judge_joints((ours or seen.states)[-1].positions, limits)
    # Commands for ros2_control are numbers without names: the order must be the arm's.
    if seen.forward_joints:
        text = f'{FORWARD} has the joints {", ".join(seen.forward_joints)}'
        is_ours = seen.forward_joints == list(limits.joint_names)
        yield _ok('order', text) if is_ours else _fault('order', f'{text}; expected {names}')
    base = seen.controller['base_frame'] if seen.controller else ''
    yield _ok('frames', f'tip {arm.tip_frame}, base {base or model.base_frame}')


def _judge_joints(positions: Mapping[str, float], limits: JointLimits) -> _Verdicts:
    names = limits.joint_names
    missing = [name for name in names if name not in positions]
    if len(missing) == len(names):
        got = ', '.join(positions)
        yield _fault('joints', f'{STATES} holds {got}; expected {", ".join(names)}')
    elif missing:
        yield _fault('joints', f'{STATES} lacks {", ".join(missing)}')
    else:
        others = ', '.join(name for name in positions if name not in names)
        ignored = f'; ignored: {others}' if others else ''
        yield _ok('joints', f'all {len(names)}{ignored}')
        yield _judge_positions(np.array([positions[name] for name in names]), limits)


def _judge_positions(q: np.ndarray, limits: JointLimits) -> _Verdict:
    if not np.isfinite(q).all():
        return _fault('positions', f'{q.tolist()}; every value must be finite')
    margin = np.minimum(q - limits.lower, limits.upper - q)  # (n,)
    j = int(np.argmin(margin))
    if margin[j] < 0.0:
        allowed = f'{limits.lower[j]:.3f} to {limits.upper[j]:.3f}'
        text = f'{limits.joint_names[j]} is at {q[j]:.3f}; allowed: {allowed}'
        return _fault('positions', text)
    return _ok('positions', 'inside all ranges')


def _judge_controller(seen: GraphSnapshot) -> _Verdicts:
    if seen.controllers > 1:
        yield _fault('controller', f'there are {seen.controllers} nodes of that name')
    if seen.controller is None:
        yield _fault('controller', 'no controller runs: start redres_controller')
        return
    if seen.problem:
        yield _note('controller', f'it reports: {seen.problem}')
    kept = seen.controller['limits']
    missing = [name for name in _NECESSARY if name not in kept]
    scale = seen.controller['limit_scale']
    if missing:
        text = f'the limits {", ".join(missing)} are not in force: add them to the parameter limits'
        yield _fault('controller', text)
    elif scale > _CAREFUL:
        text = f'limit_scale is {scale:g}; for the first steps on a robot set 0.2'
        yield _note('controller', text)
    else:
        yield _ok('controller', f'keeps {", ".join(kept)} at a scale of {scale:g}')


def _judge_commands(seen: GraphSnapshot) -> _Verdicts:
    if seen.controller is None:
        return
    forwards = ROBOT_INTERFACES[str(seen.controller['robot_interface'])].forwards_commands
    topic = FORWARD if forwards else COMMANDS
    subscribers = seen.subscribers.get(topic, ())
    if subscribers:
        yield _ok('commands', f'{topic} has the subscribers {", ".join(subscribers)}')
    else:
        advice = 'is that controller loaded and active?'
        if not forwards:
            advice = 'a robot behind ros2_control needs robot_interface: ros2_control'
        yield _fault('commands', f'{topic} has no subscriber; {advice}')
    # An inactive controller of ros2_control has its subscription, too.
    if forwards and subscribers and seen.words.get(MODE) == 'mirroring':
        command = 'ros2 control switch_controllers --activate forward_position_controller'
        text = f'the arm executes no commands: our controller mirrors it; {command}'
        yield _fault('forwarding', text)
    for other in (COMMANDS, FORWARD):
        rivals = [name for name in seen.publishers.get(other, ()) if Path(name).name != CONTROLLER]
        if rivals:
            text = f'{", ".join(rivals)} publishes {other} too; only the controller may'
            yield _fault('commands', text)


def _judge_twists(seen: GraphSnapshot) -> _Verdicts:
    sources = seen.publishers.get(TWISTS, ())
    names = ', '.join(sources)
    if not sources:
        text = f'{TWISTS} has no publisher yet: the planner, redres view or a node of yours'
        yield _note('task', text)
    elif len(sources) > 1:
        yield _note('task', f'{names} publish {TWISTS}; let only one publish at a time')
    else:
        yield _ok('task', f'{TWISTS} from {names}')
