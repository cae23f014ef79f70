"""Every message between the nodes, with every kind of fault, and what becomes of the arm.

The kinds of faults are those that PX4 injects into its sensors. All of it runs in virtual time with
the nodes as they are (virtual_graph.py), the robot as strict as a real one.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from enum import Enum
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from lifecycle_msgs.msg import Transition
from nightly import by_day
from reference_judge import ReferenceJudge, judge_graph
from virtual_graph import IDEAL, Fault, VirtualRun, virtual_run
from wire_faults import CHANNELS, FAULTS, WRENCH, Channel, make_fault

from redres_ros.nodes.conversions import to_pose, to_twist
from redres_ros.robots import find_arm
from redres_ros.robots.joint_limits import JointLimits

RATE = 100.0  # [Hz]
DURATION = 0.6  # [s] of a fault
RETREAT = 1.6  # [s] of a wrong wrench: the tip turns round, and goes 10 mm at 20 mm/s
# [rad/s] left of a null-space motion of 0.3 rad/s, which fades with 10 /s once no task moves
DECAYED = 2e-3
LIMITS = JointLimits.of(find_arm('lwr4_paper'))


class Outcome(Enum):
    """What the arm does under a fault."""

    GOES_ON = 'in command mode, and the arm moves'
    RESTS = 'comes to rest in command mode; goes on by itself'
    STOPS = 'the robot stops; goes on after `sim/reset`'
    HELD = 'the controller stops and holds it; goes on after `controller/hold` with false'
    STAYS = 'stays at rest'
    NONE = 'cannot be'


class Cell(NamedTuple):
    """What is expected: words are on a node's log."""

    outcome: Outcome
    words: str = ''


# Of each topic and listener: what becomes of the arm under the FAULTS, in their order, and words on
# a node's log.
TABLE = """
joint_states controller:
  stops timing | stops timing | stops joint_states refused | held further than it can |
    stops timing | stops timing | stops timing | goes_on before the newest one
joint_states planner:
  rests no joint_states | rests behind the robot's clock | rests joint_states refused |
    goes_on | goes_on | rests behind the robot's clock | goes_on no joint_states |
    goes_on before the newest one
joint_command sim:
  stops timing | stops timing | stops joint_command refused | stops position limit |
    stops timing | stops timing | stops timing | goes_on
cartesian_velocity controller:
  rests | rests behind the robot's clock | rests cartesian_velocity refused |
    goes_on max_linear | goes_on | rests behind the robot's clock | goes_on | goes_on
target_pose planner:
  stays | goes_on | stays target_pose refused | stays target_pose refused | none | goes_on |
    goes_on | goes_on
controller/task_scaling planner:
  rests | goes_on | rests | goes_on | goes_on | goes_on | goes_on | goes_on
sim/session_state controller:
  held the arm does not move | stays | stays | rests the arm does not move | none |
    goes_on the arm does not move | none | none
sim/stop_reason planner:
  stops protective stop | stops protective stop | stops protective stop |
    stops protective stop | none | stops protective stop | none | none
wrench controller:
  held no wrench for 0.05 s | held no wrench for 0.05 s | held expected finite values |
    held a force of 200 N on the tip | held no wrench for 0.05 s | held no wrench for 0.05 s |
    held no wrench for 0.05 s | goes_on
"""


def expected() -> dict[tuple[str, str], list[Cell]]:
    """The cells of the table, by topic and listener."""
    table = {}
    for row in TABLE.replace('\n  ', ' ').strip().splitlines():
        names, _, cells = row.partition(':')
        topic, listener = names.split()
        table[topic, listener] = [
            Cell(Outcome[outcome.upper()], words)
            for outcome, _, words in (cell.strip().partition(' ') for cell in cells.split('|'))
        ]
    return table


EXPECTED = expected()


def cells() -> list[Any]:
    """Channel, fault, and what is expected, for each cell that can be."""
    return [
        pytest.param(channel, name, cell, id=f'{channel.topic}-{channel.listener}-{name}')
        for channel in (*CHANNELS, WRENCH)
        for name, cell in zip(FAULTS, EXPECTED[channel.topic, channel.listener], strict=True)
        if cell.outcome is not Outcome.NONE
    ]


class Scene:
    """Three nodes, the arm in motion."""

    def __init__(self, run: VirtualRun) -> None:
        self.run = run

    @property
    def speed(self) -> float:
        """Of the fastest joint [rad/s]."""
        before, now = self.run.references[-2:]
        return float(np.abs(now - before).max()) * RATE

    @property
    def stopped(self) -> bool:
        """Whether the robot has stopped and says why."""
        return bool(self.run.nodes['sim']._session.reason)

    def said(self, words: str) -> bool:
        return any(words in line for _, line in self.run.graph.log)

    def suffer(self, channel: Channel, fault: Fault) -> None:
        """Let the fault act for its time, on what it is to act on."""
        graph = self.run.graph
        if channel.topic == 'sim/session_state':
            graph.call('sim/reset')  # so that it says something
            graph.faults[channel.topic, channel.listener] = fault
            self.run.run(0.3)
        self.run.run(0.0)
        graph.faults[channel.topic, channel.listener] = fault
        if channel.topic == 'target_pose':
            self._point()
        elif channel.topic == 'sim/stop_reason':
            self.run.nodes['sim']._session.stop('protective stop: for the test')
        self.run.run(RETREAT if channel is WRENCH else DURATION)
        self.under_fault = self.speed
        graph.faults.clear()

    def _point(self) -> None:
        """Show three targets, one after the other."""
        planner = self.run.nodes['planner']
        x, R = planner._model.tip(planner._q)
        for height in (0.05, 0.06, 0.07):
            self.run.graph.publish(
                'target_pose', to_pose(0, '', x + np.array((0.0, -0.1, height)), R)
            )
            self.run.run(0.05)

    def assert_nothing_jumped(self) -> None:
        """The robot's own reference keeps the arm's limits."""
        changes = np.diff(self.run.references, 2, axis=0) * RATE**2
        assert (np.abs(changes) <= LIMITS.acceleration * (1.0 + 1e-6)).all()


@pytest.mark.slow
@pytest.mark.parametrize(('channel', 'name', 'expected'), by_day(12, cells()))
def test_every_fault_of_every_message_ends_as_the_table_says(
    channel: Channel, name: str, expected: Cell
) -> None:
    moves = channel.topic != 'target_pose'
    controller = {'admittance.enabled': channel is WRENCH}
    with virtual_run(RATE, controller=controller, planner={'autostart': moves}) as run:
        judge = judge_graph(run.graph, LIMITS, RATE, 'extrapolate')
        scene = Scene(run)
        run.run(1.5)
        assert run.commanding
        assert (scene.speed > 0.01) is moves
        scene.suffer(channel, make_fault(channel, name))
        if expected.words:
            assert scene.said(expected.words)
        assert scene.stopped is (expected.outcome is Outcome.STOPS)
        if expected.outcome is Outcome.GOES_ON:
            assert scene.under_fault > 1e-3
        else:
            assert scene.under_fault < DECAYED
        if scene.stopped or channel.topic == 'sim/session_state':
            run.graph.call('sim/reset')
            assert run.run_until(lambda: run.commanding, 2.0)
        if expected.outcome is Outcome.HELD:
            run.graph.call('controller/hold', data=False)
            run.graph.call('planner/start')
        run.run(0.5)
        assert (scene.speed > 1e-3) is (expected.outcome is not Outcome.STAYS or moves)
        assert not scene.stopped
        scene.assert_nothing_jumped()
        judge.assert_followable()


class Situation(Enum):
    """What the arm does as a fault begins; the value is the controller's mode."""

    MIRRORING = 'mirroring'
    HOLDING = 'holding'
    STOPPING = 'stopping'
    INACTIVE = 'inactive'
    STARTING = ''
    AT_AN_END = 'moving'
    IN_A_CROSSFADE = 'moving '


CROSSFADE = 1.0  # [s]
OPERATOR = np.array((0.0, -0.1, 0.0))  # [m/s]
AT_AN_END = (0.49, 1.817, 2.93, 1.655, 0.25, -0.491, 0.0)  # [rad], near that of A3's range


def prepared(situation: Situation, run: VirtualRun) -> None:
    """Bring the arm into a situation, in which the fault then begins."""
    run.run(1.5)
    if situation in (Situation.HOLDING, Situation.STOPPING):
        assert run.graph.call('controller/hold', data=True).success
        run.run(1.0 if situation is Situation.HOLDING else 2.0 / RATE)
    elif situation is Situation.INACTIVE:
        assert run.change_state('controller', Transition.TRANSITION_DEACTIVATE)
        run.run(1.0)
    elif situation is Situation.IN_A_CROSSFADE:
        assert run.set('controller', law='minimum_velocity')
        run.run(2.0 / RATE)


@contextmanager
def in_a_situation(situation: Situation) -> Iterator[tuple[VirtualRun, ReferenceJudge]]:
    """Three nodes, an arm in a situation, and the judge of what is published."""
    sim: dict[str, Any] = dict(IDEAL)
    if situation is Situation.MIRRORING:
        sim['monitor_time'] = 60.0
    elif situation is Situation.AT_AN_END:
        sim['start'] = list(AT_AN_END)
    controller = {'switch_time': CROSSFADE, 'law': 'dynamically_consistent'}
    planner = {'autostart': situation is not Situation.AT_AN_END}
    with virtual_run(RATE, sim=sim, controller=controller, planner=planner) as run:
        judge = judge_graph(run.graph, LIMITS, RATE, 'extrapolate')
        if situation is Situation.AT_AN_END:
            twist = to_twist(0, '', OPERATOR)  # towards the end, again and again
            publish = run.graph.publish
            run.graph.clock.repeat(0.02, lambda: publish('cartesian_velocity', twist))
        if situation is not Situation.STARTING:
            prepared(situation, run)
            assert judge.mode == situation.value.strip()
        yield run, judge


ONCE_ONLY = ('sim/session_state', 'sim/stop_reason', 'target_pose')


def other_cells() -> list[Any]:
    """Every situation, channel and fault; by day some of them."""
    every = [
        pytest.param(
            situation,
            channel,
            name,
            id=f'{situation.name}-{channel.topic}-{channel.listener}-{name}',
        )
        for situation, channel, name in product(Situation, CHANNELS, FAULTS)
        if (channel.topic not in ONCE_ONLY or name not in ('slow', 'intermittent', 'reordered'))
        and (channel.topic != 'target_pose' or situation is not Situation.STARTING)
    ]
    return by_day(8, every)


@pytest.mark.slow
@pytest.mark.parametrize(('situation', 'channel', 'name'), other_cells())
def test_no_fault_makes_a_step_whatever_the_arm_does(
    situation: Situation, channel: Channel, name: str
) -> None:
    with in_a_situation(situation) as (run, judge):
        scene = Scene(run)
        scene.suffer(channel, make_fault(channel, name))
        run.run(0.5)
        if scene.stopped:
            run.graph.call('sim/reset')
            run.run(0.5)
        judge.assert_followable()


@pytest.mark.slow
@pytest.mark.parametrize('situation', by_day(3, Situation))
def test_without_a_fault_the_gate_never_acts(situation: Situation) -> None:
    with in_a_situation(situation) as (run, judge):
        run.run(2.0)
        judge.assert_followable()
        assert run.nodes['controller']._loop.safety_filter.count == 0
