"""Publishers, subscribers and parameters of the graph."""

from collections.abc import Iterator
from pathlib import Path

from redres_ros.loop.session import COMMANDING
from redres_ros.loop.settings import why_it_would_leap
from redres_ros.nodes.session_topics import REASON, SESSION
from redres_ros.preflight.graph_snapshot import (
    COMMANDS,
    CONTROLLER,
    FORWARD,
    STATES,
    TWISTS,
    GraphSnapshot,
)
from redres_ros.preflight.verdict import Level, Verdict

NECESSARY = ('position', 'velocity', 'acceleration')  # limits of a real arm

_CAREFUL = 0.5  # limit_scale above which a note says so


def judge_states(seen: GraphSnapshot) -> Iterator[Verdict]:
    publishers = seen.publishers.get(STATES, ())
    names = ', '.join(publishers)
    if not publishers:
        yield Verdict(Level.FAULT, 'states', f'nobody publishes {STATES} in this ROS domain')
    elif not seen.states:
        text = f'{names} publishes {STATES}, but none came; is the robot running?'
        yield Verdict(Level.FAULT, 'states', text)
    elif len(publishers) > 1:
        text = f'{names} publish {STATES}; only one may publish the joints of the arm'
        yield Verdict(Level.NOTE, 'states', text)
    else:
        yield Verdict(Level.OK, 'states', f'from {names}')


def judge_session(seen: GraphSnapshot) -> Iterator[Verdict]:
    reason = seen.words.get(REASON, '')
    session = seen.words.get(SESSION, '')
    if reason:
        yield Verdict(Level.FAULT, 'session', f'the robot has stopped: {reason}')
    elif session and session not in COMMANDING:
        yield Verdict(Level.NOTE, 'session', f'the robot takes no commands yet: {session}')
    elif session:
        yield Verdict(Level.OK, 'session', session)


def judge_controller(seen: GraphSnapshot) -> Iterator[Verdict]:
    if seen.controllers > 1:
        yield Verdict(Level.FAULT, 'controller', f'there are {seen.controllers} of that name')
    if seen.controller is None:
        yield Verdict(Level.FAULT, 'controller', 'none runs: start redres_controller')
        return
    kept = seen.controller['limits']
    missing = [name for name in NECESSARY if name not in kept]
    scale = seen.controller['limit_scale']
    if missing:
        text = f'the limits {", ".join(missing)} are not in force: add them to the parameter limits'
        yield Verdict(Level.FAULT, 'controller', text)
    elif scale > _CAREFUL:
        text = f'limit_scale is {scale:g}; for the first steps on a robot set 0.2'
        yield Verdict(Level.NOTE, 'controller', text)
    else:
        yield Verdict(Level.OK, 'controller', f'keeps {", ".join(kept)} at a scale of {scale:g}')


def judge_commands(seen: GraphSnapshot) -> Iterator[Verdict]:
    if seen.controller is None:
        return
    forward = bool(seen.controller['forward_commands'])
    topic = FORWARD if forward else COMMANDS
    listeners = seen.subscribers.get(topic, ())
    if listeners:
        yield Verdict(Level.OK, 'commands', f'{topic} has the subscribers {", ".join(listeners)}')
    else:
        advice = 'is that controller loaded and active?'
        if not forward:
            advice = f'a robot behind ros2_control needs forward_commands, which uses {FORWARD}'
        yield Verdict(Level.FAULT, 'commands', f'nobody listens to {topic}; {advice}')
    if leap := why_it_would_leap(forward, str(seen.controller['bridging'])):
        yield Verdict(Level.FAULT, 'commands', leap)
    for other in (COMMANDS, FORWARD):
        rivals = [name for name in seen.publishers.get(other, ()) if not _is_controller(name)]
        if rivals:
            text = f'{", ".join(rivals)} publishes {other} too; only the controller may'
            yield Verdict(Level.FAULT, 'commands', text)


def _is_controller(name: str) -> bool:
    return Path(name).name == CONTROLLER


def judge_twists(seen: GraphSnapshot) -> Iterator[Verdict]:
    sources = seen.publishers.get(TWISTS, ())
    names = ', '.join(sources)
    if not sources:
        text = f'nobody publishes {TWISTS} yet: the planner, redres teleop or a node of yours'
        yield Verdict(Level.NOTE, 'task', text)
    elif len(sources) > 1:
        text = f'{names} publish {TWISTS}; let only one of them speak at a time'
        yield Verdict(Level.NOTE, 'task', text)
    else:
        yield Verdict(Level.OK, 'task', f'{TWISTS} from {names}')
