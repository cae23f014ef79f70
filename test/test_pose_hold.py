"""What an operator does not ask for stays where it is; a planner's velocities are left alone."""

from collections.abc import Callable

import numpy as np
import pytest
from test_command_loop import JOINT_LIMITS, Robot, T

from redres_ros import Controller, RobotModel
from redres_ros.kernels.tick import rotation_error
from redres_ros.loop.command_loop import CommandLoop
from redres_ros.loop.modes import Mode
from redres_ros.nodes.policy_parameters import END_OF_REACH

Velocity = Callable[[float], np.ndarray]


class Arm(Robot):
    """An FR3 with an ideal servo, and its operator."""

    def __init__(self, limits: tuple[str, ...] = JOINT_LIMITS) -> None:
        self.model = RobotModel.named('fr3')
        self.controller = Controller(
            self.model,
            'minimum_acceleration',
            T,
            task='pose',
            limits=limits,
            limit_gains={'acceleration.reach': END_OF_REACH} if limits else {},
            switch_time=0.0,
        )
        self.loop = CommandLoop(self.controller)
        super().__init__(self.loop, np.array(self.model.arm.start))

    def run(self, seconds: float, velocity: Velocity, *, stamped: bool = False) -> None:
        """Steer for so many seconds, by what a function of time says."""
        for _ in range(round(seconds / T)):
            self.ask()
            self.steer(velocity(self.now), None if stamped else 0)

    def turned(self, R: np.ndarray) -> float:
        """The angle from an orientation [rad]."""
        return float(np.linalg.norm(rotation_error(R, self.model.tip(self.q)[1])))


def sideways(t: float) -> np.ndarray:
    return np.array((0.0, 0.15 * np.sin(t), 0.1 * np.cos(2.0 * t), 0.0, 0.0, 0.0))


def turning(t: float) -> np.ndarray:
    return np.array((0.0, 0.0, 0.0, 0.3 * np.sin(t), 0.2 * np.cos(2.0 * t), 0.0))


@pytest.mark.slow
def test_translation_alone_does_not_turn_the_tip():
    arm = Arm()
    _, R = arm.model.tip(arm.q)
    arm.run(8.0, sideways)
    first = arm.turned(R)
    arm.run(8.0, sideways)
    assert first < np.radians(0.05)
    assert arm.turned(R) - first < np.radians(0.05) * 8.0 / 60.0


@pytest.mark.slow
def test_a_planners_velocities_are_executed_as_they_are():
    """It closes a loop of its own: the same velocities, stamped with states, drift as ever."""
    arm = Arm()
    _, R = arm.model.tip(arm.q)
    arm.run(8.0, sideways, stamped=True)
    drifted = arm.turned(R)
    steered = Arm()
    steered.run(8.0, sideways)
    assert drifted > 10.0 * steered.turned(R)
    assert arm.controller.policy.scaling == 'task'
    assert steered.controller.policy.scaling == 'components'


def stretched() -> Arm:
    arm = Arm()
    arm.run(1.0, lambda _: np.array((0.1, 0.0, 0.1, 0.0, 0.0, 0.0)))
    arm.run(4.0, lambda _: np.array((0.15, 0.0, 0.0, 0.0, 0.0, 0.0)))
    arm.run(0.2, lambda _: np.zeros(6))
    return arm


def tilting(t: float) -> np.ndarray:
    """Leads a stretched arm's held position out of reach."""
    return np.array((0.0, 0.0, 0.0, 0.0, 0.3, 0.0))


@pytest.mark.slow
def test_a_position_that_could_not_be_held_comes_back_when_the_turn_is_reversed():
    arm = stretched()
    x, _ = arm.model.tip(arm.q)
    arm.run(2.5, tilting)
    assert np.linalg.norm(arm.model.tip(arm.q)[0] - x) > 0.02
    arm.run(4.0, lambda t: -0.4 * tilting(t))
    assert np.linalg.norm(arm.model.tip(arm.q)[0] - x) < 1e-3


@pytest.mark.parametrize('limits', [(), JOINT_LIMITS])
def test_what_is_asked_for_again_begins_without_a_jump(limits):
    arm = Arm(limits)
    for seconds, velocity in ((2.0, sideways), (1.0, turning), (1.0, sideways)):
        arm.run(seconds, velocity)
    V = np.array([arm.model.tip(q)[0] for q in arm.references])
    acceleration = np.linalg.norm(np.diff(V, 2, axis=0), axis=1) / T**2
    assert acceleration.max() < 3.0  # [m/s^2]; 2 of the twist buffer


def along(v: tuple[float, ...], *rotation: float) -> Velocity:
    return lambda _: np.array((*v, *(rotation or (0.0, 0.0, 0.0))))


OUT = (-0.2, 0.0, -0.25)  # [m/s], beyond where the orientation can be kept
BACK = (0.1, 0.0, 0.125)


@pytest.mark.slow
def test_a_tip_that_limits_have_turned_comes_back():
    """Limits turn it while it is dragged beyond where its orientation can be kept."""
    arm = Arm()
    _, R = arm.model.tip(arm.q)
    arm.run(2.0, along(OUT))
    assert arm.turned(R) > np.radians(3.0)
    arm.run(4.0, along(BACK))
    assert arm.turned(R) < np.radians(0.5)


@pytest.mark.slow
@pytest.mark.parametrize('law', ['minimum_acceleration', 'minimum_velocity'])
def test_what_was_turned_comes_back_after_the_arm_has_been_held_and_the_law_changed(law):
    arm = Arm()
    _, R = arm.model.tip(arm.q)
    arm.run(2.0, along(OUT))
    turned = arm.turned(R)
    arm.run(2.0, along((0.0, 0.0, 0.0)))
    assert arm.loop.mode is Mode.HOLDING
    arm.controller.switch_law(law)
    assert np.radians(3.0) < turned < np.radians(26.0)
    arm.run(3.0, along(BACK))
    assert arm.turned(R) < np.radians(0.5)


@pytest.mark.slow
def test_noise_of_the_joystick_does_not_count_as_asked():
    arm = Arm()
    _, R = arm.model.tip(arm.q)
    random = np.random.default_rng(0)
    arm.run(8.0, lambda t: sideways(t) + 1e-4 * random.normal(size=6))
    assert arm.turned(R) < np.radians(0.05)


@pytest.mark.slow
def test_after_a_smooth_pause_the_arm_goes_on_at_once():
    """A filtered joystick never comes to exact zero; what is held has not come back."""
    arm = Arm()
    arm.run(4.0, along(OUT))
    begin = arm.cycle * T
    arm.run(8.0, lambda t: np.exp((begin - t) / 0.5) * along(OUT)(t))
    assert arm.loop.mode is Mode.HOLDING
    assert not arm.loop.error
    x, _ = arm.model.tip(arm.q)
    arm.run(1.0, along(BACK))
    assert np.linalg.norm(arm.model.tip(arm.q)[0] - x) > 0.1


@pytest.mark.slow
def test_what_is_asked_for_is_held_where_it_is_left():
    arm = Arm()
    arm.run(1.0, along((0.0, 0.0, 0.0), 0.0, 0.0, 0.3))
    arm.run(1.0, sideways)
    _, R = arm.model.tip(arm.q)
    arm.run(4.0, sideways)
    assert arm.turned(R) < np.radians(0.5)
