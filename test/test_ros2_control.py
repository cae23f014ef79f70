"""An arm behind ros2_control, whose controllers come and go while it moves: what is written to its
hardware never steps beyond the arm's limits.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from nightly import NIGHTLY, by_day
from reference_judge import ReferenceJudge, judge_graph
from stand_in import COMMANDS, PARAMETERS, Habits, StandIn, behind_ros2_control
from std_msgs.msg import Float64MultiArray
from virtual_graph import Graph
from wire_faults import off

from redres_ros.files.installation import share_path
from redres_ros.nodes.conversions import to_pose, to_twist
from redres_ros.robot_model import RobotModel
from redres_ros.robots import find_arm
from redres_ros.robots.joint_limits import JointLimits

pytestmark = pytest.mark.slow

FILE = share_path('config/robots/lbr_iiwa7.yaml')
ARM = find_arm('iiwa7')
LIMITS = JointLimits.of(ARM)
RATES = (100.0, 1000.0, 500.0, 125.0)  # [Hz]; by_day() takes the last ones, which cost less
NOTICED = 0.05  # [s] after which the controller knows that the arm does not move
SENT_EVERY = 0.02  # [s] by an operator
SPEED = 0.1  # [m/s] of an operator
AIM = np.array((0.0, 0.3, 0.0))  # [m] from where the tip is


@dataclass
class Scene:
    """A robot behind ros2_control, and all that judges it."""

    graph: Graph
    robot: StandIn
    published: ReferenceJudge
    rate: float

    @property
    def speed(self) -> float:
        """Of the fastest joint in what was published last [rad/s]."""
        (before, r_before), (now, r) = self.published.references[-2:]
        return float(np.abs(r - r_before).max()) / ((now - before) / 1e9)

    def advance(self, seconds: float) -> None:
        self.graph.clock.advance(seconds)

    def assert_well(self) -> None:
        """Nothing that was published or written stepped."""
        self.published.assert_followable()
        self.robot.hardware.assert_followable()


@contextmanager
def scene(directory: Path, rate: float, habits: Habits | None = None) -> Iterator[Scene]:
    """An iiwa behind ros2_control at another rate; its own speed limits are not what acts here."""
    given = FILE.read_text()
    path = directory / 'robot.yaml'
    changed = given.replace('rate: 100.0', f'rate: {rate}').replace('_scale: 0.2', '_scale: 1.0')
    path.write_text(changed.replace('target_speed: 0.05', f'target_speed: {SPEED}'))
    with behind_ros2_control(path) as graph:
        graph.kept['controller/mode'] = []
        published = judge_graph(graph, LIMITS, rate, 'hold')
        robot = StandIn(graph, LIMITS, np.array(ARM.start), rate, habits=habits)
        yield Scene(graph, robot, published, rate)


def plan(graph: Graph, robot: StandIn, aim: np.ndarray = AIM) -> None:
    x, R = RobotModel(ARM).tip(robot.q)
    graph.publish('target_pose', to_pose(0, '', x + aim, R))


def teleoperate(graph: Graph, robot: StandIn) -> None:
    """Steer the tip to one side, and go on doing so."""
    forward = SPEED * AIM / np.linalg.norm(AIM)

    def send() -> None:
        graph.publish('cartesian_velocity', to_twist(0, '', forward))

    graph.clock.repeat(SENT_EVERY, send)


Move = Callable[[Graph, StandIn], None]
SOURCES = pytest.mark.parametrize('move', [plan, teleoperate], ids=['planner', 'teleoperation'])
# Rate [Hz] and time for which the controller is inactive [s]; all of them at night.
OFF = tuple(product(RATES, (0.1, 0.2, 1.0, 3.0)))
FEW = ((500.0, 0.2), (100.0, 3.0))


@SOURCES
@pytest.mark.parametrize(('rate', 'off'), OFF if NIGHTLY else FEW)
def test_re_activated_in_motion_the_forwarding_controller_gets_no_step(
    rate: float, off: float, move: Move, tmp_path: Path
) -> None:
    with scene(tmp_path, rate) as now:
        now.advance(0.5)
        move(now.graph, now.robot)
        now.advance(1.0)
        assert now.speed > 0.01
        now.robot.deactivate()
        now.advance(off)
        now.robot.activate()
        now.advance(1.0)
        now.assert_well()


@SOURCES
@pytest.mark.parametrize('rate', by_day(1, RATES))
def test_an_arm_that_does_not_move_although_it_is_commanded_is_noticed(
    rate: float, move: Move, tmp_path: Path
) -> None:
    with scene(tmp_path, rate) as now:
        now.advance(0.5)
        move(now.graph, now.robot)
        now.advance(1.0)
        now.robot.deactivate()
        at = now.graph.clock.now
        now.advance(NOTICED + 2.0 / rate)
        words = [word.data for time, word in now.graph.kept['controller/mode'] if time > at]
        assert words, 'the mode has not changed'
        assert words[0] != 'moving'


def test_the_arm_stands_until_its_operator_has_let_go(tmp_path: Path) -> None:
    with scene(tmp_path, 500.0) as now:
        teleoperate(now.graph, now.robot)
        now.advance(1.0)
        now.robot.deactivate()
        now.advance(1.0)
        stood = now.robot.q
        now.robot.activate()
        now.advance(2.0)
        np.testing.assert_array_equal(now.robot.q, stood)
        assert sum('the arm does not move' in line for _, line in now.graph.log) == 1
        now.graph.faults['cartesian_velocity', 'controller'] = off()
        now.advance(1.0)
        np.testing.assert_array_equal(now.robot.q, stood)
        now.graph.faults.clear()
        now.advance(1.0)
        assert np.abs(now.robot.q - stood).max() > 0.01
        now.assert_well()


def test_an_arm_with_a_servo_and_no_fault_is_never_taken_for_one_that_does_not_move(
    tmp_path: Path,
) -> None:
    with scene(tmp_path, 100.0, Habits(servo=0.04)) as now:
        teleoperate(now.graph, now.robot)
        now.advance(3.0)
        modes = now.published.modes
        assert 'mirroring' not in modes[modes.index('moving') :]
        assert now.speed > 0.01
        now.assert_well()


def disturb(now: Scene, fault: str) -> None:
    """Do to a moving robot what happens to real ones."""
    if fault == 'wrong length':
        now.graph.publish(COMMANDS, Float64MultiArray(data=[0.0]))
        now.advance(1.0)
        now.robot.activate()
    elif fault == 'read error':
        now.robot.fail_read()
        now.advance(1.0)
        now.robot.recover()
    else:
        for _ in range(2):
            now.robot.deactivate()
            now.advance(0.2)
            now.robot.activate()
            now.advance(0.03)


@SOURCES
@pytest.mark.parametrize('rate', by_day(1, RATES))
@pytest.mark.parametrize('fault', by_day(2, ['wrong length', 'read error', 'twice']))
def test_what_is_published_stays_within_the_limits_whatever_ros2_control_does(
    fault: str, rate: float, move: Move, tmp_path: Path
) -> None:
    with scene(tmp_path, rate) as now:
        move(now.graph, now.robot)
        now.advance(1.0)
        disturb(now, fault)
        now.advance(1.0)
        now.published.assert_followable()


@pytest.mark.parametrize('rate', by_day(1, RATES))
@pytest.mark.parametrize(
    'habits',
    by_day(1, [Habits(dropped=0.2), Habits(velocities=False), Habits(jitter=0.0)]),
    ids=str,
)
def test_a_broadcaster_with_habits_of_its_own_gets_no_step(
    habits: Habits, rate: float, tmp_path: Path
) -> None:
    with scene(tmp_path, rate, habits) as now:
        teleoperate(now.graph, now.robot)
        now.advance(1.5)
        assert np.abs(now.robot.q - ARM.start).max() > 0.01
        now.assert_well()


@pytest.mark.parametrize(('rate', 'seconds'), by_day(3, product(RATES, [0.005, 0.02, 0.3])))
def test_after_an_overrun_and_a_burst_of_states_the_arm_moves_on(
    seconds: float, rate: float, tmp_path: Path
) -> None:
    with scene(tmp_path, rate) as now:
        teleoperate(now.graph, now.robot)
        now.advance(1.0)
        now.robot.overrun(seconds)
        now.advance(1.0)
        assert now.speed > 0.01
        # The hardware stops by itself: what it had not yet executed by then is its own step.
        now.published.assert_followable()


def test_before_the_first_command_the_order_of_the_joints_is_compared(tmp_path: Path) -> None:
    with scene(tmp_path, 500.0) as now:
        kind, right = now.graph.services[PARAMETERS]

        def reversed_order(request: Any, response: Any) -> Any:
            replied = right(request, response)
            for value in replied.values:
                value.string_array_value = value.string_array_value[::-1]
            return replied

        now.graph.services[PARAMETERS] = (kind, reversed_order)
        teleoperate(now.graph, now.robot)
        now.advance(1.0)
        assert now.robot.commands == 0
        wrong = 'forward_position_controller has the joints lbr_A7'
        assert any(wrong in line for _, line in now.graph.log)
        now.robot.q = now.robot.q + 0.02  # it sinks meanwhile
        now.graph.services[PARAMETERS] = (kind, right)
        now.advance(2.0)
        assert now.speed > 0.01
        now.robot.hardware.assert_followable()


WAYS = (0.004, 0.03, 0.08, 0.4)  # [rad] of each joint, back from its range's end
RESTED_MOVED_LATER = ((0.5, 0.7, 2.0), (0.05, 0.7, 2.0), (0.5, 0.2, 0.02))  # [s]
FEW_WAYS = ((125.0, 0.03), (100.0, 0.4), (500.0, 0.004))
EXPLAINED = 0.005  # [rad] by a servo at rest


def elsewhere(now: Scene, case: str, way: np.ndarray) -> None:
    """Have somebody else move a robot whose controller holds, until its forwarding controller is
    active again.
    """
    robot = now.robot
    if case == 'beside a trajectory controller':
        robot.deactivate()
        now.advance(1.0)
    else:
        now.advance(0.5)
        plan(now.graph, robot, AIM if case == 'in motion' else AIM / 3.0)
        moves = case in ('in motion', 'in the last motion')
        now.advance(1.0 if moves else 4.0)
        assert now.published.modes[-1] == ('moving' if moves else 'holding')
    if case == 'after an error of the hardware':
        robot.fail_read()
        now.advance(0.5)
        robot.put(robot.q + way)
        now.advance(1.5)
        robot.recover()
        return
    robot.carry(way, 1.0)
    now.advance(1.5)
    robot.activate()


@pytest.mark.parametrize(('rate', 'way'), product(RATES, WAYS) if NIGHTLY else FEW_WAYS)
@pytest.mark.parametrize(
    'case',
    [
        'beside a trajectory controller',
        'after a target',
        'in motion',
        'in the last motion',  # whose command comes to rest beside it, without a fault
        'after an error of the hardware',
    ],
)
def test_an_arm_that_others_have_moved_does_not_go_back(
    case: str, rate: float, way: float, tmp_path: Path
) -> None:
    with scene(tmp_path, rate) as now:
        now.graph.listen(COMMANDS, 'recorder', lambda message: None)
        elsewhere(now, case, -way * np.sign(ARM.start))
        stood = now.robot.q
        now.advance(1.0)
        assert np.abs(now.robot.q - stood).max() <= (EXPLAINED if way < EXPLAINED else 1e-5)
        now.published.assert_followable()
        if way > EXPLAINED:
            now.robot.hardware.assert_followable()
            teleoperate(now.graph, now.robot)
            now.advance(1.0)
            assert now.speed > 0.01
            now.assert_well()


@pytest.mark.parametrize('rate', by_day(1, RATES))
@pytest.mark.parametrize(('rested', 'moved', 'later'), RESTED_MOVED_LATER)
def test_an_arm_that_others_move_while_its_command_moves_does_not_go_back(
    rested: float, moved: float, later: float, rate: float, tmp_path: Path
) -> None:
    with scene(tmp_path, rate) as now:
        now.advance(rested)
        plan(now.graph, now.robot, AIM / 3.0)
        now.advance(moved)
        now.robot.carry(-0.08 * np.sign(ARM.start), 0.3)
        now.advance(0.3 + later)
        now.robot.activate()
        stood = now.robot.q
        now.advance(0.5)
        assert np.abs(now.robot.q - stood).max() <= 1e-5
        now.robot.hardware.assert_followable()


@pytest.mark.parametrize('rate', by_day(2, RATES))
@pytest.mark.parametrize('way', [0.08, 0.4])  # [rad]
def test_an_arm_that_others_move_is_taken_over_where_it_is(
    way: float, rate: float, tmp_path: Path
) -> None:
    with scene(tmp_path, rate) as now:
        now.advance(0.5)
        now.robot.carry(-way * np.sign(ARM.start), 1.0)
        now.advance(0.7)
        now.robot.activate()
        now.advance(1.0 / rate)
        moved = now.robot.q
        now.advance(0.5)
        np.testing.assert_array_equal(now.robot.q, moved)


@pytest.mark.parametrize(
    ('stalled', 'first'), by_day(2, product([0.4, 2.0], ['joint_states', 'cartesian_velocity']))
)
def test_velocities_from_before_a_stall_of_the_process_do_not_move_the_arm(
    stalled: float, first: str, tmp_path: Path
) -> None:
    with scene(tmp_path, 100.0) as now:
        now.advance(1.0)
        before = now.robot.q
        now.graph.stall('controller')
        teleoperate(now.graph, now.robot)
        now.advance(0.2)
        now.graph.faults['cartesian_velocity', 'controller'] = off()
        now.advance(stalled - 0.2)  # longer than velocities are good for
        now.graph.resume('controller', first)
        now.advance(1.0)
        np.testing.assert_array_equal(now.robot.q, before)
