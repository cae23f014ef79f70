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

    def to(self, *path: float, cycles: int = 1, mode: str = '') -> None:
        """Publish positions [rad], each some cycles after the last one; in another mode."""
        if mode:
            self.judge.enter_mode(mode)
        for self.q in path:
            self.cycle += cycles
            self.judge.enter_reference(self.stamp(), np.array((self.q, 0.0)))

    def stamp(self, later: int = 0) -> int:
        """Of the last reference [ns], or some cycles later."""
        return round(1e9 * T * (self.cycle + later))

    def accelerate(self, speed: float) -> None:
        """Go from rest to a speed [rad/s] as fast as that is allowed."""
        self.to(self.q)
        step = 0.0
        while step < speed * T:
            step = min(step + A * T**2, speed * T)
            self.to(self.q + step)

    @property
    def rules(self) -> set[str]:
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


WRONG: dict[str, Callable[[Publisher], None]] = {  # by the rule that is broken
    'velocity': too_fast,
    'acceleration': lambda arm: arm.to(0.0, 1.001 * A * T**2),
    'range': lambda arm: arm.to(1.0, 1.0001),
    'finite': lambda arm: arm.to(np.nan),
    'constant while holding': lambda arm: arm.to(0.5, np.nextafter(0.5, 1.0), mode='holding'),
    'silent while inactive': lambda arm: arm.to(0.5, mode='inactive'),
    'repeated for the same state': lambda arm: arm.to(0.5, 0.5001, cycles=0),
    'in the order of stamps': lambda arm: arm.to(0.5, 0.5, cycles=-1),
}


@BOTH
@pytest.mark.parametrize('rule', WRONG)
def test_what_no_robot_could_follow_is_noted(rule: str, bridging: str) -> None:
    arm = Publisher(bridging)
    WRONG[rule](arm)
    assert arm.rules == {rule}


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
    arm.to(0.3, mode=mode)
    arm.to(0.3, cycles=150)
    assert arm.rules == set()
    arm.judge.enter_state(arm.stamp(150), np.array((0.31, 0.0)))
    arm.to(0.31, cycles=150)
    assert arm.rules != set()


def test_mirroring_it_may_be_wherever_the_arm_is() -> None:
    arm = Publisher('extrapolate')
    arm.to(0.0, 0.5, -0.5, mode='mirroring')
    assert arm.rules == set()
    for cycle in (1, 2):
        arm.judge.enter_state(arm.stamp(cycle), np.array((1.05, 0.0)))
    arm.to(1.05)
    assert arm.rules == set()
    arm.to(1.04)
    assert arm.rules == {'mirrored'}
