"""Publishers, subscribers and parameters of the graph."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from redres_ros.loop.cycle_counter import NANOSECONDS, ClockError, CycleCounter
from redres_ros.loop.session import COMMANDING
from redres_ros.nodes.topics import REASON, SESSION
from redres_ros.preflight.arm import ExpectedArm, Verdict, fault, judge_arm, note, ok
from redres_ros.preflight.graph_snapshot import (
    ACTIVITY,
    COMMANDS,
    CONTROLLER,
    FORWARD,
    STATES,
    TWISTS,
    GraphSnapshot,
    StateSeen,
)
from redres_ros.robot_interface import ROBOT_INTERFACES


def judge(seen: GraphSnapshot, expected: ExpectedArm | None) -> list[Verdict]:
    """All verdicts, the robot's first.

    Args:
        seen: Snapshot of the graph.
        expected: What is expected if no controller runs; None: not known.
    """
    if seen.controller:
        parameters = seen.controller
        margin = parameters.get('position.margin') or 0.0
        expected = ExpectedArm(
            parameters['robot'], parameters['tip_frame'], parameters['rate'], margin
        )
    verdicts = [*_judge_states(seen), *_judge_session(seen)]
    if expected is None:
        text = 'no controller runs and no --robot is named: joints and limits are not known'
        verdicts.append(fault('arm', text))
    else:
        verdicts += _judge_stamps(seen.states, expected.rate)
        verdicts += judge_arm(seen, expected)
    return [*verdicts, *_judge_controller(seen), *_judge_commands(seen), *_judge_twists(seen)]


_FEWEST = 10  # states for an estimate of the rate
_RATE_ERROR = 0.02  # fraction by which the rate may differ
_HALF = 0.5  # of a period: stamps that jitter by more are ambiguous
_FEW = 0.01  # fraction of stamps that may jitter by more
_CLOCKS = 1.0  # [s] by which two clocks may differ without a note


def _judge_stamps(states: tuple[StateSeen, ...], rate: float) -> Iterator[Verdict]:
    """Whether the states come in order at the expected rate [Hz]."""
    if not states:
        return
    stamps = np.array([state.stamp for state in states]) / 1e9  # [s]
    if not stamps.all():
        yield fault('stamps', f'{STATES} without a stamp')
        return
    stamps = np.unique(stamps)  # a robot that waits for its response sends a state again
    if len(stamps) < _FEWEST:
        yield fault('rate', f'only {len(stamps)} states came; too few to estimate the rate')
        return
    period = float(np.median(np.diff(stamps)))  # [s]
    if abs(period * rate - 1.0) > _RATE_ERROR:
        text = f'{1.0 / period:.4g} states a second; expected {rate:g}: change the parameter rate'
        yield fault('rate', text)
    else:
        yield ok('rate', f'{1.0 / period:.4g} states a second')
        yield _judge_jitter(states, rate)
    apart = states[-1].arrived / NANOSECONDS - stamps[-1]
    if abs(apart) > _CLOCKS:
        text = f"the robot's clock is {apart:.3g} s from this computer's; stamp task velocities 0"
        yield note('clock', text)


def _judge_jitter(states: tuple[StateSeen, ...], rate: float) -> Verdict:
    """Whether the controller, which counts cycles in the same way, can number every state."""
    cycles = CycleCounter(round(NANOSECONDS / rate))
    stamps: list[int] = []  # [ns]
    numbers: list[int] = []
    refused = 0
    for state in states:
        if state.stamp == cycles.newest:
            continue
        try:
            cycles.enter(state.stamp, state.arrived / NANOSECONDS)
        except ClockError:
            refused += 1
            continue
        stamps.append(state.stamp - states[0].stamp)
        numbers.append(cycles.number)
    expected = np.polynomial.Polynomial.fit(numbers, stamps, 1)
    errors = np.abs(np.array(stamps) - expected(np.array(numbers))) / cycles.period
    lost = numbers[-1] - numbers[0] + 1 - len(numbers)
    gaps = f'; {lost} states did not come' if lost else ''
    text = f'stamps jitter by {100.0 * errors.max():.1f} % of a period at most{gaps}'
    unclear = refused + int(np.sum(errors > _HALF))
    if unclear > _FEW * len(states):
        text += f'; the cycle of {unclear} states is not clear, as they jitter by half a period'
        return fault('jitter', text)
    return ok('jitter', text)


_NECESSARY = ('position', 'velocity', 'acceleration')  # limits of a real arm

_CAREFUL = 0.5  # limit_scale above which a note says so


def _judge_states(seen: GraphSnapshot) -> Iterator[Verdict]:
    publishers = seen.publishers.get(STATES, ())
    names = ', '.join(publishers)
    if not publishers:
        yield fault('states', f'{STATES} has no publisher in this ROS domain')
    elif not seen.states:
        yield fault('states', f'{names} publishes {STATES}, but none came; is the robot running?')
    elif len(publishers) > 1:
        text = f'{names} publish {STATES}; only one may publish the joints of the arm'
        yield note('states', text)
    else:
        yield ok('states', f'from {names}')


def _judge_session(seen: GraphSnapshot) -> Iterator[Verdict]:
    reason = seen.words.get(REASON, '')
    session = seen.words.get(SESSION, '')
    if reason:
        yield fault('session', f'the robot has stopped: {reason}')
    elif session and session not in COMMANDING:
        yield note('session', f'the robot takes no commands yet: {session}')
    elif session:
        yield ok('session', session)


def _judge_controller(seen: GraphSnapshot) -> Iterator[Verdict]:
    if seen.controllers > 1:
        yield fault('controller', f'there are {seen.controllers} nodes of that name')
    if seen.controller is None:
        yield fault('controller', 'no controller runs: start redres_controller')
        return
    kept = seen.controller['limits']
    missing = [name for name in _NECESSARY if name not in kept]
    scale = seen.controller['limit_scale']
    if missing:
        text = f'the limits {", ".join(missing)} are not in force: add them to the parameter limits'
        yield fault('controller', text)
    elif scale > _CAREFUL:
        text = f'limit_scale is {scale:g}; for the first steps on a robot set 0.2'
        yield note('controller', text)
    else:
        yield ok('controller', f'keeps {", ".join(kept)} at a scale of {scale:g}')


def _judge_commands(seen: GraphSnapshot) -> Iterator[Verdict]:
    if seen.controller is None:
        if seen.forward_states or seen.hardware:  # a robot behind ros2_control
            yield from _judge_forwarding(seen)
        return
    forward = ROBOT_INTERFACES[str(seen.controller['robot_interface'])].forwards_commands
    topic = FORWARD if forward else COMMANDS
    listeners = seen.subscribers.get(topic, ())
    if listeners:
        yield ok('commands', f'{topic} has the subscribers {", ".join(listeners)}')
    else:
        advice = 'is that controller loaded and active?'
        if not forward:
            advice = 'a robot behind ros2_control needs robot_interface: ros2_control'
        yield fault('commands', f'{topic} has no subscriber; {advice}')
    if forward and listeners:
        yield from _judge_forwarding(seen)
    for other in (COMMANDS, FORWARD):
        rivals = [name for name in seen.publishers.get(other, ()) if Path(name).name != CONTROLLER]
        if rivals:
            text = f'{", ".join(rivals)} publishes {other} too; only the controller may'
            yield fault('commands', text)


def _judge_forwarding(seen: GraphSnapshot) -> Iterator[Verdict]:
    """Whether ros2_control's controller takes the commands that reach it: an inactive one has its
    subscription, too.
    """
    states = seen.forward_states
    command = 'ros2 control switch_controllers --activate forward_position_controller'
    if states and 'active' not in states:
        text = f'the forward_position_controller is {", ".join(sorted(states))}: {command}'
        yield fault('forwarding', text)
    elif seen.mode == 'mirroring':
        text = f'the arm executes no commands: our controller mirrors it; {command}'
        yield fault('forwarding', text)
    elif not states:
        text = (
            'no controller_manager reports on /diagnostics whether the forward_position_controller '
            'is active; one that is not shows in the first motion, within 50 ms'
        )
        if seen.publishers.get(ACTIVITY):
            text += f'. Install controller_manager_msgs here: then {ACTIVITY} can be read, too'
        yield note('forwarding', text)
    else:
        yield ok('forwarding', 'the forward_position_controller is active')
    for name, state in sorted(seen.hardware.items()):
        if state != 'active':
            command = f'ros2 control set_hardware_component_state {name} active'
            yield note('hardware', f'{name} is {state}: {command}')


def _judge_twists(seen: GraphSnapshot) -> Iterator[Verdict]:
    sources = seen.publishers.get(TWISTS, ())
    names = ', '.join(sources)
    if not sources:
        text = f'{TWISTS} has no publisher yet: the planner, redres view or a node of yours'
        yield note('task', text)
    elif len(sources) > 1:
        yield note('task', f'{names} publish {TWISTS}; let only one publish at a time')
    else:
        yield ok('task', f'{TWISTS} from {names}')
