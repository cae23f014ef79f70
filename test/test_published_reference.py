"""What leaves the controller, seen from outside: held it stands still, inactive it is silent, and
nothing that happens between two ticks makes a step. The real node, in virtual time.
"""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from nightly import by_day

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from diagnostic_msgs.msg import DiagnosticStatus
from lifecycle_msgs.msg import Transition
from reference_judge import ReferenceJudge, judge_graph
from stand_in import Habits, StandIn, behind_ros2_control
from virtual_graph import IDEAL, Fault, Graph, VirtualRun, virtual_run

from redres_ros.files.installation import share_path
from redres_ros.nodes.conversions import to_twist
from redres_ros.robot_model import RobotModel
from redres_ros.robots import find_arm
from redres_ros.robots.joint_limits import JointLimits

pytestmark = pytest.mark.slow

RATE = 500.0  # [Hz]
ARM = find_arm('lwr4_paper')
LIMITS = JointLimits.of(ARM)
START = np.array(ARM.start)
SIDEWAYS = np.array((0.0, -0.1, 0.0))  # [m/s]
NEAR_THE_END = np.array((-1.8, 1.2, 0.0, 0.6, 0.0, -0.3, 0.0))  # [rad], of A1's range
STANDING = np.zeros(3)


@dataclass
class Operator:
    """Somebody at a joystick: the same velocity again and again, with a stamp of zero."""

    graph: Graph
    velocity: np.ndarray = field(default_factory=lambda: STANDING)  # [m/s]
    every: float = 0.01  # [s]
    sending: bool = True

    def __post_init__(self) -> None:
        self.graph.clock.repeat(self.every, self._send)

    def _send(self) -> None:
        if self.sending:
            self.graph.publish('cartesian_velocity', to_twist(0, '', self.velocity))


class Iiwa(NamedTuple):
    """The same behind ros2_control, without a session."""

    graph: Graph
    robot: StandIn
    judge: ReferenceJudge
    operator: Operator


class Arm:
    """A robot and its controller, an operator, and the judge of what is published."""

    def __init__(self, run: VirtualRun, judge: ReferenceJudge) -> None:
        self.run = run
        self.graph = run.graph
        self.judge = judge
        self.operator = Operator(run.graph)

    @property
    def reference(self) -> np.ndarray:
        """What was published last, (n,) [rad]."""
        return self.judge.references[-1][1]

    @property
    def speed(self) -> float:
        """Of the fastest joint in what was published last [rad/s]."""
        (before, r_before), (now, r) = self.judge.references[-2:]
        return float(np.abs(r - r_before).max()) / ((now - before) / 1e9)

    @property
    def stop_reason(self) -> str:
        """Why the robot has stopped; empty if it has not."""
        reason: str = self.run.nodes['sim']._session.reason
        return reason

    def go(self, velocity: np.ndarray, seconds: float) -> None:
        self.operator.velocity = velocity
        self.run.run(seconds)

    def hold(self, wanted: bool) -> bool:
        return bool(self.graph.call('controller/hold', data=wanted).success)

    def published_in(self, seconds: float) -> np.ndarray:
        """All references of some time, (N, n) [rad]."""
        count = len(self.judge.references)
        self.run.run(seconds)
        return np.array([r for _, r in self.judge.references[count:]])


@contextmanager
def commanded(
    start: np.ndarray = START,
    rate: float = RATE,
    controller_rate: float = 0.0,
    **controller: Any,
) -> Iterator[Arm]:
    """An arm in command mode that stands still; the robot goes exactly where it is sent."""
    sim = {**IDEAL, 'start': start.tolist()}
    controller['rate'] = controller_rate or rate
    with virtual_run(rate, sim=sim, controller=controller) as run:
        run.graph.kept['/diagnostics'] = []
        arm = Arm(run, judge_graph(run.graph, LIMITS, rate, 'extrapolate'))
        run.run_until(lambda: run.commanding, 3.0)
        run.run(0.1)
        yield arm


def offset(joint: int, by: float) -> Fault:
    """States in which one joint is off."""

    def fault(message: Any, now: float) -> list[tuple[float, Any]]:
        changed = deepcopy(message)
        changed.position[joint] += by
        return [(0.0, changed)]

    return fault


TOO_HEAVY = {'limits': ['position', 'velocity', 'acceleration', 'torque'], 'torque_scale': 0.15}
IN_AN_OBSTACLE = {'limits': ['position', 'velocity', 'acceleration', 'collision']}


@contextmanager
def held(**controller: Any) -> Iterator[Arm]:
    """An arm that has moved, and was then asked to hold."""
    with commanded(**controller) as arm:
        arm.go(SIDEWAYS, 0.5)
        assert arm.hold(True)
        arm.go(STANDING, 1.0)
        yield arm


def make_too_heavy(arm: Arm) -> None:
    """Leave the arm's torque limits less than its own weight asks for."""
    assert arm.run.set('controller', **TOO_HEAVY)


def put_an_obstacle_at_the_tip(arm: Arm) -> None:
    """Make the tip collide."""
    x, _ = RobotModel(ARM).tip(arm.reference)
    sphere = f'sphere {x[0]} {x[1]} {x[2]} 0.1'
    assert arm.run.set('controller', **{'scene.obstacles': sphere}, **IN_AN_OBSTACLE)


def shift_an_encoder(arm: Arm) -> None:
    """Have a joint measured 1 rad off from now on."""
    arm.graph.faults['joint_states', 'controller'] = offset(2, 1.0)


MOVES_A_HELD_ARM = (make_too_heavy, put_an_obstacle_at_the_tip, shift_an_encoder)


@pytest.mark.parametrize('change', by_day(2, MOVES_A_HELD_ARM), ids=lambda change: change.__name__)
def test_what_would_move_a_held_arm_is_an_error_and_moves_it_by_no_bit(change: Any) -> None:
    with held() as arm:
        before = arm.reference
        change(arm)
        references = arm.published_in(2.5)
        assert len(references) > 0.9 * 2.5 * RATE
        assert np.abs(references - before).max() == 0.0
        health = arm.run.health('controller')
        assert health.level == DiagnosticStatus.ERROR, health.message


def test_an_inactive_controller_publishes_nothing_although_a_joint_is_outside_its_range() -> None:
    start = START.copy()
    start[2] = LIMITS.upper[2] + 0.05
    sim = {**IDEAL, 'start': start.tolist()}
    with virtual_run(RATE, sim=sim, controller={'initial_state': 'inactive'}) as run:
        judge = judge_graph(run.graph, LIMITS, RATE, 'extrapolate')
        run.run(2.0)
    assert judge.references == []


def turn_to_the_end(arm: Arm, seconds: float) -> None:
    """Steer the tip around the base, so that A1 comes to the end of its range."""
    model = RobotModel(ARM)
    for _ in range(round(seconds / 0.02)):
        x, _ = model.tip(arm.reference)
        around = np.array((x[1], -x[0], 0.0))
        arm.go(around / np.linalg.norm(around), 0.02)


def test_a_robot_of_another_rate_keeps_its_limits_and_is_an_error_that_names_both() -> None:
    with commanded(NEAR_THE_END, rate=100.0, controller_rate=500.0) as arm:
        turn_to_the_end(arm, 2.5)
        health = arm.run.health('controller')
        assert health.level == DiagnosticStatus.ERROR, health.message
        assert '100' in health.message and '500' in health.message
        assert arm.speed == 0.0
        assert arm.stop_reason == ''
        arm.judge.assert_followable()


IIWA = JointLimits.of(find_arm('iiwa7'))
IIWA_FILE = share_path('config/robots/lbr_iiwa7.yaml')


@contextmanager
def iiwa(directory: Path, habits: Habits | None = None, **changes: str) -> Iterator[Iiwa]:
    """An iiwa behind ros2_control at 100 Hz, an operator, and the judge of what is published."""
    text = IIWA_FILE.read_text()
    for name, value in changes.items():
        text = re.sub(f'{name}: .*', f'{name}: {value}', text)
    path = directory / 'robot.yaml'
    path.write_text(text)
    with behind_ros2_control(path) as graph:
        judge = judge_graph(graph, IIWA, 100.0, 'hold')
        robot = StandIn(graph, IIWA, np.array(find_arm('iiwa7').start), 100.0, habits=habits)
        graph.clock.advance(0.5)
        yield Iiwa(graph, robot, judge, Operator(graph))


@pytest.mark.parametrize('rate', [100.0, 500.0])
def test_one_state_that_is_off_does_not_step_a_reference_from_the_measurement(rate: float) -> None:
    with commanded(rate=rate, integrate_from='measurement') as arm:
        arm.go(SIDEWAYS, 0.5)
        arm.graph.faults['joint_states', 'controller'] = offset(1, 0.09)
        arm.run.run(1.0 / rate)
        arm.graph.faults.clear()
        arm.run.run(0.5)
        arm.judge.assert_followable()


@pytest.mark.parametrize(
    ('stalled', 'first'), by_day(2, product([0.4, 2.0], ['joint_states', 'cartesian_velocity']))
)
def test_velocities_from_before_a_stall_of_the_process_do_not_move_the_arm(
    stalled: float, first: str, tmp_path: Path
) -> None:
    with iiwa(tmp_path) as now:
        now.operator.sending = False
        now.graph.clock.advance(0.5)
        before = now.judge.references[-1][1]
        now.graph.stall('controller')
        now.operator.velocity = np.array((0.0, 0.1, 0.0))
        now.operator.sending = True
        now.graph.clock.advance(0.2)
        now.operator.sending = False
        now.graph.clock.advance(stalled - 0.2)  # longer than velocities are good for
        now.graph.resume('controller', first)
        now.graph.clock.advance(1.0)
        model = RobotModel(find_arm('iiwa7'))
        way = model.tip(now.judge.references[-1][1])[0] - model.tip(before)[0]
        assert np.linalg.norm(way) < 1e-6


def test_an_inactive_controller_cannot_be_made_to_resume() -> None:
    with commanded() as arm:
        arm.run.change_state('controller', Transition.TRANSITION_DEACTIVATE)
        assert not arm.hold(False)


@pytest.mark.parametrize('pause', by_day(1, [0.0, 0.004, 0.05]))
def test_cleaned_up_right_after_it_was_deactivated_it_brings_the_arm_to_rest_first(
    pause: float,
) -> None:
    with commanded() as arm:
        arm.go(5.0 * SIDEWAYS, 1.0)
        arm.run.change_state('controller', Transition.TRANSITION_DEACTIVATE)
        arm.run.run(pause)
        arm.run.change_state('controller', Transition.TRANSITION_CLEANUP)
        arm.run.run(2.0)
        last_steps = np.abs(np.diff([r for _, r in arm.judge.references[-2:]], axis=0))
        assert (last_steps <= LIMITS.acceleration / RATE**2 + 1e-9).all()
