"""The judge of published references sees what it is there for, and nothing else."""

from collections.abc import Callable

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from reference_judge import ReferenceJudge

from redres_ros.robots.joint_limits import JointLimits

T = 0.01  # [s]
A = 2.0  # [rad/s^2]
V = 1.0  # [rad/s]
LIMITS = JointLimits(('a', 'b'), np.full(2, -1.0), np.full(2, 1.0), np.full(2, V), np.full(2, A))
BOTH = pytest.mark.parametrize('bridging', ['hold', 'extrapolate'])


class Publisher:
    """Publishes references of joint a, one a cycle."""

    def __init__(self, bridging: str) -> None:
        self.judge = ReferenceJudge(LIMITS, T, bridging)
        self.cycle = 100
        self.q = 0.0  # [rad]

    def to(self, q: float, cycles: int = 1) -> None:
        """Publish q [rad] some cycles after the last one."""
        self.cycle += cycles
        self.q = q
        self.judge.enter_reference(round(1e9 * T * self.cycle), np.array((q, 0.0)))

    def accelerate(self, speed: float) -> None:
        """Go from rest to a speed [rad/s] as fast as that is allowed."""
        self.to(self.q)
        step = 0.0
        while step < speed * T:
            step = min(step + A * T**2, speed * T)
            self.to(self.q + step)

    @property
    def rules(self) -> set[str]:
        """Those that were broken."""
        return {violation.rule for violation in self.judge.violations}


@BOTH
def test_the_fastest_allowed_motion_is_well(bridging: str) -> None:
    arm = Publisher(bridging)
    arm.accelerate(0.99 * V)
    arm.to(arm.q + V * T)
    assert arm.rules == set()


def too_fast(arm: Publisher) -> None:
    arm.accelerate(V)
    arm.to(arm.q + 1.001 * V * T)


def too_sudden(arm: Publisher) -> None:
    arm.to(0.0)
    arm.to(1.001 * A * T**2)


def out_of_range(arm: Publisher) -> None:
    arm.to(1.0)
    arm.to(1.0001)


def not_finite(arm: Publisher) -> None:
    arm.to(np.nan)


def creeping(arm: Publisher) -> None:
    arm.judge.enter_mode('holding')
    arm.to(0.5)
    arm.to(np.nextafter(0.5, 1.0))


def talking(arm: Publisher) -> None:
    arm.judge.enter_mode('inactive')
    arm.to(0.5)


def of_two_minds(arm: Publisher) -> None:
    arm.to(0.5)
    arm.to(0.5001, cycles=0)


def back_in_time(arm: Publisher) -> None:
    arm.to(0.5)
    arm.to(0.5, cycles=-1)


@BOTH
@pytest.mark.parametrize(
    ('publish', 'rules'),
    [
        (too_fast, {'velocity'}),
        (too_sudden, {'acceleration'}),
        (out_of_range, {'range'}),
        (not_finite, {'finite'}),
        (creeping, {'constant while holding'}),
        (talking, {'silent while inactive'}),
        (of_two_minds, {'repeated for the same state'}),
        (back_in_time, {'in the order of stamps'}),
    ],
)
def test_what_no_robot_could_follow_is_noted(
    publish: Callable[[Publisher], None], rules: set[str], bridging: str
) -> None:
    arm = Publisher(bridging)
    publish(arm)
    assert arm.rules == rules


@pytest.mark.parametrize(
    ('bridging', 'step', 'well'),
    [
        ('extrapolate', 3 * 0.5 * T, True),
        ('extrapolate', 0.5 * T, False),
        ('hold', A * T**2, True),
        ('hold', 0.5 * T, False),
    ],
)
def test_after_two_cycles_without_a_reference_the_robot_is_where_it_bridged_to(
    bridging: str, step: float, well: bool
) -> None:
    arm = Publisher(bridging)
    arm.accelerate(0.5)
    arm.to(arm.q + step, cycles=3)
    assert (arm.rules == set()) is well


def test_outside_the_range_only_the_way_back_is_allowed() -> None:
    arm = Publisher('extrapolate')
    arm.to(1.1)
    arm.judge.violations.clear()
    arm.to(1.1 - A * T**2)
    assert arm.rules == set()
    arm.to(1.1)
    assert 'range' in arm.rules


@pytest.mark.parametrize(('bridging', 'mode'), [('hold', 'moving'), ('extrapolate', 'holding')])
def test_after_a_long_silence_too_an_arm_that_holds_is_where_it_was(
    bridging: str, mode: str
) -> None:
    arm = Publisher(bridging)
    arm.judge.enter_mode(mode)
    arm.to(0.3)
    arm.to(0.3, cycles=150)
    assert arm.rules == set()
    arm.judge.enter_state(round(1e9 * T * (arm.cycle + 150)), np.array((0.31, 0.0)))
    arm.to(0.31, cycles=150)
    assert arm.rules != set()


def test_mirroring_it_may_be_wherever_the_arm_is() -> None:
    arm = Publisher('extrapolate')
    arm.judge.enter_mode('mirroring')
    for q in (0.0, 0.5, -0.5):
        arm.to(q)
    assert arm.rules == set()
    for cycle in (1, 2):
        arm.judge.enter_state(round(1e9 * T * (arm.cycle + cycle)), np.array((1.05, 0.0)))
    arm.to(1.05)
    assert arm.rules == set()
    arm.to(1.04)
    assert arm.rules == {'mirrored'}
