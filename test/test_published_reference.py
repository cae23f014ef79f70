"""What leaves the controller, seen from outside: held it stands still, and nothing that happens
between two ticks makes a step. The real node, in virtual time.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from nightly import by_day

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from diagnostic_msgs.msg import DiagnosticStatus
from lifecycle_msgs.msg import Transition
from reference_judge import ReferenceJudge, judge_graph
from virtual_graph import VirtualRun, virtual_run
from wire_faults import changed

from redres_ros.nodes.conversions import to_twist
from redres_ros.robot_model import RobotModel
from redres_ros.robots import find_arm
from redres_ros.robots.joint_limits import JointLimits

pytestmark = pytest.mark.slow

RATE = 500.0  # [Hz]
ARM = find_arm('lwr4_paper')
LIMITS = JointLimits.of(ARM)
SIDEWAYS = np.array((0.0, -0.1, 0.0))  # [m/s]


class Arm:
    """A robot and its controller, somebody at a joystick, and the judge of what is published."""

    def __init__(self, run: VirtualRun, judge: ReferenceJudge) -> None:
        self.run = run
        self.judge = judge
        self.velocity = np.zeros(3)  # of the joystick [m/s]
        run.graph.clock.repeat(0.01, self._send)

    def _send(self) -> None:
        self.run.graph.publish('cartesian_velocity', to_twist(0, '', self.velocity))

    def go(self, velocity: np.ndarray, seconds: float) -> None:
        self.velocity = velocity
        self.run.run(seconds)

    def hold(self, wanted: bool) -> bool:
        return bool(self.run.graph.call('controller/hold', data=wanted).success)

    def set_off(self, joint: int, by: float) -> None:
        """Have a joint measured so far off from now on [rad]."""

        def offset(message: Any) -> None:
            message.position[joint] += by

        self.run.graph.faults['joint_states', 'controller'] = changed(offset)


@contextmanager
def commanded(rate: float = RATE, **controller: Any) -> Iterator[Arm]:
    """An arm in command mode that stands still; the robot goes exactly where it is sent."""
    with virtual_run(rate, controller=controller) as run:
        run.graph.kept['/diagnostics'] = []
        arm = Arm(run, judge_graph(run.graph, LIMITS, rate, 'extrapolate'))
        run.run_until(lambda: run.commanding, 3.0)
        run.run(0.1)
        yield arm


def make_too_heavy(arm: Arm) -> None:
    limits = ['position', 'velocity', 'acceleration', 'torque']
    assert arm.run.set('controller', limits=limits, torque_scale=0.15)


def put_an_obstacle_at_the_tip(arm: Arm) -> None:
    x, _ = RobotModel(ARM).tip(arm.judge.references[-1][1])
    limits = ['position', 'velocity', 'acceleration', 'collision']
    scene = {'scene.obstacles': f'sphere {x[0]} {x[1]} {x[2]} 0.1'}
    assert arm.run.set('controller', limits=limits, **scene)


def shift_an_encoder(arm: Arm) -> None:
    arm.set_off(2, 1.0)


MOVES_A_HELD_ARM = (make_too_heavy, put_an_obstacle_at_the_tip, shift_an_encoder)


@pytest.mark.parametrize('change', by_day(2, MOVES_A_HELD_ARM), ids=lambda change: change.__name__)
def test_what_would_move_a_held_arm_is_an_error_and_moves_it_by_no_bit(change: Any) -> None:
    with commanded() as arm:
        arm.go(SIDEWAYS, 0.5)
        assert arm.hold(True)
        arm.go(np.zeros(3), 1.0)
        count = len(arm.judge.references)
        change(arm)
        arm.run.run(2.5)
        references = np.array([r for _, r in arm.judge.references[count - 1 :]])
        assert len(references) > 0.9 * 2.5 * RATE
        assert np.abs(references - references[0]).max() == 0.0
        health = arm.run.health('controller')
        assert health.level == DiagnosticStatus.ERROR, health.message


@pytest.mark.parametrize('rate', [100.0, 500.0])
def test_one_state_that_is_off_does_not_step_a_reference_from_the_measurement(rate: float) -> None:
    with commanded(rate, integrate_from='measurement') as arm:
        arm.go(SIDEWAYS, 0.5)
        arm.set_off(1, 0.09)
        arm.run.run(1.0 / rate)
        arm.run.graph.faults.clear()
        arm.run.run(0.5)
        arm.judge.assert_followable()


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
