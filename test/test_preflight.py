"""`redres check`: what it says of graphs in which something is missing."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from programs import run_python

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from graph_helpers import PATIENCE, await_that, graph, nodes

from redres_ros.nodes.topics import MODE, REASON, SESSION
from redres_ros.preflight import snapshot
from redres_ros.preflight.snapshot import (
    COMMANDS,
    FORWARD,
    STATES,
    TWISTS,
    GraphSnapshot,
    SnapshotNode,
    StateSeen,
)
from redres_ros.preflight.verdicts import FAULT, NOTE, OK, ExpectedArm, _Verdict, judge
from redres_ros.robots import ARMS, find_arm
from redres_ros.robots.joint_limits import JointLimits

ARM = find_arm('lwr4')
NAMES = JointLimits.of(ARM).joint_names
T = 2_000_000  # [ns]
RATE = 100.0  # [Hz] of a graph
BEGIN = 1_700_000_000 * 10**9
CONTROLLER = {
    'rate': 500.0,
    'robot': 'lwr4',
    'tip_frame': '',
    'base_frame': '',
    'robot_interface': 'fri',
    'limits': ['position', 'velocity', 'acceleration'],
    'limit_scale': 0.2,
}


def states(
    positions: Callable[[int], Any] = lambda k: ARM.start,
    stamp: Callable[[int], int] = lambda k: BEGIN + k * T,
    names: tuple[str, ...] = NAMES,
) -> list[StateSeen]:
    """A hundred states, the k-th of which is as the functions of k say."""
    return [StateSeen(stamp(k), dict(zip(names, positions(k), strict=False))) for k in range(100)]


GOOD = GraphSnapshot(
    states=states(),
    publishers={STATES: ['/robot'], COMMANDS: ['/controller'], TWISTS: ['/planner']},
    subscribers={COMMANDS: ['/robot']},
    controller=CONTROLLER,
    controllers=1,
)


def beyond(subject: str, seen: GraphSnapshot, wanted: ExpectedArm | None = None) -> _Verdict:
    [verdict] = [found for found in judge(seen, wanted) if found.subject == subject]
    return verdict


def test_where_all_is_well_every_finding_is_ok() -> None:
    assert {verdict.level for verdict in judge(GOOD, None)} == {OK}


BEHIND = replace(
    GOOD,
    controller={**CONTROLLER, 'robot_interface': 'ros2_control'},
    subscribers={FORWARD: ['/forward_position_controller']},
    publishers={STATES: ['/robot'], FORWARD: ['/controller'], TWISTS: ['/planner']},
    forward_joints=[*NAMES],
    words={MODE: 'holding'},
)
OUTSIDE = (9.0, *ARM.start[1:])


def good(**changed: Any) -> GraphSnapshot:
    return replace(GOOD, **changed)


def controlled(**changed: Any) -> GraphSnapshot:
    return good(controller={**CONTROLLER, **changed})


def with_another(names: tuple[str, ...]) -> GraphSnapshot:
    """The good graph, with a second broadcaster 25 us after the first one."""
    other = states(stamp=lambda k: BEGIN + k * T + 25_000, names=names)
    both = sorted([*GOOD.states, *other], key=lambda state: state.stamp)
    return good(states=both, publishers={**GOOD.publishers, STATES: ['/fingers', '/robot']})


WITH_RIVAL = {**GOOD.publishers, FORWARD: ['/gui']}
WITH_TWO_SOURCES = {**GOOD.publishers, TWISTS: ['/planner', '/view']}


FAULTS = [  # what is seen, subject of the fault, words in it
    (good(publishers={}, states=[]), 'states', 'joint_states has no publisher'),
    (good(states=[]), 'states', 'none came'),
    (with_another(NAMES), 'states', 'come twice, from /fingers, /robot; only one may'),
    (controlled(rate=100.0), 'rate', '500 states a second; expected 100'),
    (good(states=states(stamp=lambda k: 0)), 'stamps', 'without a stamp'),
    (good(states=states(names=NAMES[:6])), 'joints', f'lacks {NAMES[6]}'),
    (good(states=states(names=('a', 'b'))), 'joints', 'holds a, b; expected lwr_a1_joint'),
    (good(states=states(lambda k: OUTSIDE)), 'positions', 'at 9.000; allowed: -2.967 to 2.967'),
    (good(states=states(lambda k: [np.nan] * 7)), 'positions', 'finite'),
    (controlled(robot='r2d2'), 'arm', "'r2d2'"),
    (controlled(robot='topic'), 'arm', 'robot_description, which has no publisher'),
    (good(controller=None, controllers=0), 'controller', 'start redres_controller'),
    (good(controllers=2), 'controller', 'there are 2'),
    (controlled(limits=['position']), 'controller', 'velocity, acceleration are not in force'),
    (good(subscribers={}), 'commands', 'needs robot_interface'),
    (controlled(robot_interface='ros2_control'), 'commands', f'{FORWARD} has no subscriber'),
    (good(publishers=WITH_RIVAL), 'commands', f'/gui publishes {FORWARD} too'),
    (replace(BEHIND, words={MODE: 'mirroring'}), 'forwarding', 'no commands'),
    (good(forward_joints=[*NAMES[::-1]]), 'order', f'has the joints {NAMES[6]}'),
    (good(words={REASON: 'protective stop'}), 'session', 'stopped: protective stop'),
]

NOTES = [
    (controlled(limit_scale=1.0), 'controller', 'limit_scale is 1'),
    (good(problem='joint_states refused: late'), 'controller', 'reports: joint_states refused'),
    (good(publishers=WITH_TWO_SOURCES), 'task', '/planner, /view publish'),
    (with_another(('left', 'right')), 'states', '/fingers, /robot publish joint_states; only one'),
    (good(words={SESSION: 'MON'}), 'session', 'takes no commands yet: MON'),
]

JUDGED = [*((FAULT, *each) for each in FAULTS), *((NOTE, *each) for each in NOTES)]


@pytest.mark.parametrize(('level', 'seen', 'subject', 'words'), JUDGED)
def test_what_is_missing_is_a_fault_with_a_remedy_and_what_one_should_know_a_note(
    level: str, seen: GraphSnapshot, subject: str, words: str
) -> None:
    verdicts = judge(seen, None)
    assert level == FAULT or FAULT not in {verdict.level for verdict in verdicts}
    found = [(verdict.subject, verdict.text) for verdict in verdicts if verdict.level == level]
    assert any(subject == about and words in text for about, text in found), found


def test_states_of_a_second_broadcaster_without_joints_of_the_arm_are_not_counted() -> None:
    assert beyond('rate', with_another(('left', 'right'))).text == '500 states a second'


def test_a_gripper_among_the_joints_is_ignored() -> None:
    seen = good(states=states(lambda k: (*ARM.start, 0.02), names=(*NAMES, 'finger')))
    assert beyond('joints', seen).text == 'all 7; ignored: finger'


def test_without_a_controller_the_arm_named_is_the_one_that_is_looked_at() -> None:
    seen = good(controller=None, controllers=0)
    assert beyond('joints', seen, ExpectedArm('lwr4')).level == OK
    assert beyond('rate', seen, ExpectedArm('lwr4', rate=100.0)).level == FAULT


def test_what_the_controller_reports_on_diagnostics_is_noted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(snapshot, '_DISCOVERY', 0.0)
    with graph(SnapshotNode) as (node, _):
        report = DiagnosticStatus(
            name='controller', message='it fails', level=DiagnosticStatus.ERROR
        )
        node._on_diagnostics(DiagnosticArray(status=[report]))
        assert node.look(0.0).problem == 'it fails'


def test_the_arm_on_the_topic_is_looked_at_by_its_description() -> None:
    of_a_topic = controlled(robot='topic', tip_frame='tool0')
    seen = replace(of_a_topic, description=ARMS['lwr4'].description())
    assert beyond('joints', seen).text == 'all 7'


check = partial(run_python, '-m', 'redres_ros.cli', 'check')


@pytest.mark.slow
def test_a_graph_passes_when_the_controller_runs_and_not_before(tmp_path: Path) -> None:
    sim = {'rate': RATE, 'patience': PATIENCE}
    parameters = {'sim': sim, 'controller': {'rate': RATE, 'limit_scale': 0.2}}
    with nodes(tmp_path, **parameters) as (probe, processes):
        # The listener is on both topics, too.
        await_that(lambda: probe.count_subscribers('joint_command') > 1, 'the robot')
        await_that(lambda: probe.count_publishers('joint_command') > 0, 'the controller')
        for duration in ('2', '4', '8', '16'):  # on a busy machine nodes are found late
            passed = check('--duration', duration)
            if passed.returncode == 0:
                break
        processes['controller'].end()
        failed = check('--robot', 'lwr4_paper', '--rate', f'{RATE:g}', '--duration', '2')
    assert passed.returncode == 0, passed.stdout + passed.stderr
    assert failed.returncode == 1
    assert 'no controller runs' in failed.stdout
