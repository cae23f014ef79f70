"""The command loop with contact: when an arm yields, when it holds, and what stops it."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from test_command_loop import GENTLE, JOINT_LIMITS, START, Robot, T

from redres_ros import Controller, RobotModel, make_law
from redres_ros.contact import AdmittanceSettings, ContactControl, ContactError
from redres_ros.errors import UnknownNameError
from redres_ros.loop.command_loop import CommandLoop
from redres_ros.loop.modes import Mode

pytestmark = pytest.mark.slow

MODEL = RobotModel.named('lwr4_paper')
NOTHING = np.zeros(3)
PUSH = np.array((0.0, 10.0, 0.0))  # [N] in the base frame
Force = Callable[[np.ndarray], np.ndarray]  # of q, (3,) [N]
FREE = AdmittanceSettings(enabled=True, damping=(200.0,) * 3)


class LoopedArm(Robot):
    """With a force sensor at its tip, and torques from outside."""

    def __init__(
        self, controller: Controller, q: np.ndarray, contact: ContactControl | None = None
    ) -> None:
        self.loop = CommandLoop(controller, contact=contact)
        super().__init__(self.loop, q)
        self.model = controller.model

    def run(
        self,
        seconds: float,
        force: Force | np.ndarray | None = None,
        dx: np.ndarray | None = None,
        torques: np.ndarray | None = None,
    ) -> np.ndarray:
        """References (N, n) [rad] of some time under a force (3,) [N] in the base frame, that may
        depend on q, or with a silent sensor; with a task velocity (3,) [m/s], and with torques
        (n,) [Nm].
        """
        begin = len(self.references)
        for _ in range(round(seconds / T)):
            if force is not None:
                R = self.model.tip(self.q)[1]
                on_tip = force(self.q) if callable(force) else force
                wrench = np.concatenate((R.T @ on_tip, NOTHING))
                self.loop.measurements.contact.sensor.enter(wrench)
            if torques is not None:
                self.loop.measurements.enter('external_torques', 0, torques)
            if dx is not None:
                self.loop.enter_velocity(0, dx, self.now + T)
            assert self.ask() is not None
        return np.array(self.references[begin:])

    def holds(self, force: np.ndarray) -> bool:
        """Whether it stays where it is under a force."""
        before = self.q
        return bool((self.run(0.5, force) == before).all()) and self.loop.mode is Mode.HOLDING


class PushedArm(LoopedArm):
    """One that yields to forces on its tip."""

    def __init__(self, settings: AdmittanceSettings) -> None:
        law = make_law('minimum_acceleration', damping=10.0)
        controller = Controller(MODEL, law, T, switch_time=0.1, limits=JOINT_LIMITS)
        super().__init__(controller, START, ContactControl(settings, T, switch_time=0.1))
        self.run(0.1, NOTHING)
        self.x0 = MODEL.tip(self.q)[0]

    @property
    def moved(self) -> np.ndarray:
        """By how much the tip has moved, (3,) [m]."""
        return MODEL.tip(self.q)[0] - self.x0


def test_an_arm_at_rest_yields_to_a_push_and_then_holds_again() -> None:
    arm = PushedArm(FREE)
    assert (arm.q == START).all()
    assert arm.holds(NOTHING)
    arm.run(1.0, PUSH)
    assert arm.loop.mode is Mode.MOVING
    # 10 N / 200 N s/m for a second, less the fades
    assert arm.moved[1] == pytest.approx(0.05, abs=0.01)
    assert np.abs(arm.moved[[0, 2]]).max() < 1e-4
    arm.run(3.0, NOTHING)
    assert arm.holds(NOTHING)
    assert arm.loop.error == ''


def test_an_arm_yields_neither_held_nor_without_admittance() -> None:
    arm = PushedArm(FREE)
    arm.loop.hold(True)
    assert arm.holds(PUSH)
    arm.loop.hold(False)
    arm.run(0.5, PUSH)
    assert arm.loop.mode is Mode.MOVING
    assert PushedArm(replace(FREE, enabled=False)).holds(PUSH)


def test_a_task_velocity_and_a_push_add_up_and_when_one_ends_the_other_goes_on() -> None:
    arm = PushedArm(FREE)
    arm.run(1.0, PUSH, 10.0 * GENTLE)
    # 30 mm/s against 50 mm/s, less the fades
    assert arm.moved[1] == pytest.approx(0.02, abs=0.01)
    references = arm.run(1.0, PUSH)
    assert arm.loop.mode is Mode.MOVING
    ddq = np.diff(references, n=2, axis=0) / T**2
    assert np.abs(ddq).max() < 20.0  # [rad/s^2], the limits are 20.9 and more


@pytest.mark.parametrize('force', [None, np.full(3, np.nan)])
def test_a_wrench_that_fails_stops_the_arm_until_somebody_lets_it_go_on(force: Any) -> None:
    arm = PushedArm(FREE)
    arm.run(0.5, PUSH)
    arm.run(1.0, force)
    assert arm.loop.error
    assert arm.holds(PUSH)
    arm.loop.hold(False)
    arm.run(0.5, PUSH)
    assert arm.loop.mode is Mode.MOVING


SLOT = (-1e-4, 1e-4)  # [m]
WALL = (-np.inf, 0.02)  # met fast: the force grows while the arm brakes


@pytest.mark.parametrize(
    ('sign', 'speed', 'walls', 'words', 'most'),
    [
        (1.0, 0.1, SLOT, 'the retreat met a force of', 90.0),
        (-1.0, 0.05, SLOT, 'the retreat met a force of', 120.0),
        (-1.0, 0.5, SLOT, 'the retreat met a force of', 150.0),
        (1.0, 0.5, WALL, 'the tip has retreated', 200.0),
    ],
)
def test_a_retreat_ends_where_the_force_opposes_it_or_grows(
    sign: float, speed: float, walls: tuple[float, float], words: str, most: float
) -> None:
    """A peg meets walls of 50 kN/m; its sensor may have the wrong sign."""
    arm = PushedArm(replace(FREE, damping=(1000.0,) * 3, force_limit=80.0))
    pressed = []

    def between_walls(q: np.ndarray) -> np.ndarray:
        y = (MODEL.tip(q)[0] - arm.x0)[1]
        force = 5e4 * (np.clip(y, *walls) - y)
        pressed.append(abs(force))
        return sign * np.array((0.0, force, 0.0))

    arm.run(0.5, between_walls, np.array((0.0, speed, 0.0)))
    arm.run(1.0, between_walls)
    assert words in arm.loop.error
    assert 80.0 < max(pressed) < most


def test_the_force_limit_counts_for_an_arm_that_holds() -> None:
    arm = PushedArm(replace(FREE, force=tuple(PUSH)))
    arm.run(2.0, PUSH)
    assert arm.holds(PUSH)
    lower = replace(FREE, force=tuple(PUSH), force_limit=5.0)
    arm.loop.measurements.contact.set_settings(lower)
    arm.run(2.0, PUSH)
    assert 'the tip has retreated' in arm.loop.error


def test_an_arm_is_led_by_hand_for_long_while_zero_twists_are_streamed() -> None:
    arm = PushedArm(FREE)
    for side in (1.0, -1.0, 1.0, -1.0):
        arm.run(1.6, side * PUSH, NOTHING)
    assert arm.loop.error == ''
    assert arm.loop.mode is Mode.MOVING


def test_admittance_that_goes_on_in_motion_waits_for_the_first_wrench() -> None:
    arm = PushedArm(replace(FREE, enabled=False))
    arm.loop.measurements.enter_wrench(0, np.full(6, 1e3), '')  # of long ago
    arm.run(0.3, None, GENTLE)
    arm.loop.measurements.contact.set_settings(FREE)
    arm.run(0.04, None, GENTLE)
    assert arm.loop.error == arm.loop.warning == ''
    arm.run(0.2, None, GENTLE)
    assert 'no wrench for 0.05 s' in arm.loop.error


def test_an_arm_that_moves_or_presses_is_not_tared() -> None:
    arm = PushedArm(replace(FREE, force=(0.0, 10.0, 0.0)))
    with pytest.raises(ContactError, match='the arm is moving; expected one at rest'):
        arm.loop.tare()
    arm.run(2.0, PUSH)
    with pytest.raises(ContactError, match='the arm yields to the force'):
        arm.loop.tare()
    arm.loop.hold(True)
    arm.run(0.1, PUSH)
    arm.loop.tare()


def test_a_wrench_in_a_frame_that_does_not_exist_is_refused_and_moves_nothing() -> None:
    arm = PushedArm(FREE)
    with pytest.raises(UnknownNameError, match="unknown frame 'nose'"):
        arm.loop.measurements.enter_wrench(0, np.ones(6), 'nose')
    assert arm.holds(NOTHING)
