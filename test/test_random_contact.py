"""Random wrenches, sensors that fail, and changes in contact, through the command loop.

Pure, in virtual time, as test_random_pairs: an ideal robot whose tip meets a table, where all that
concerns contact happens at random. By day a sample of it, with REDRES_NIGHTLY=1 all.
"""

from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='the judge listens to ROS 2: pip install .[test]')

from nightly import NIGHTLY
from test_random_pairs import DISTURBANCES, World

from redres_ros.contact import AdmittanceSettings, ContactControl
from redres_ros.errors import RedresError
from redres_ros.loop.command_loop import CommandLoop
from redres_ros.preferences import Compliance, Posture

pytestmark = pytest.mark.slow

TICKS = 200_000 if NIGHTLY else 20_000
WORLDS = 100 if NIGHTLY else 4
SEEDS = range(1000, 1000 + WORLDS)
STEPS = (1e2, 1e4, 1e6, 1e200)  # [N]


class ContactWorld(World):
    """The world of test_random_pairs with a table, a force sensor, and torques from outside."""

    def __init__(self, seed: int) -> None:
        super().__init__(seed)
        chance = self.chance
        self.model = self.controller.model
        self.settings = AdmittanceSettings.of_rows(self.controller.m)
        self.contact = ContactControl(self.settings, self.T, switch_time=0.2)
        preferences = Compliance(), Posture()
        self.controller.set_policy(replace(self.controller.policy, preferences=preferences))
        self.loop = CommandLoop(self.controller, contact=self.contact)
        self.stiffness = 10.0 ** chance.uniform(2.0, 5.0)  # [N/m]
        self.height = self.model.tip(self.robot.q)[0][2] - 0.005  # [m] of the table
        self.step_of_force = np.zeros(6)
        self.change_settings()

    def step(self) -> None:
        self._sense()
        super().step()

    def _sense(self) -> None:
        """Enter what the sensors show of the table and of the disturbances."""
        if self._has('drop-out') or self._has('stall'):
            return
        chance = self.chance
        x, R = self.model.tip(self.robot.q)
        wrench = np.zeros(6)
        wrench[2] = self.stiffness * max(self.height - x[2], 0.0)
        if self._has('spikes') and chance.random() < 0.2:
            wrench += chance.choice(STEPS) * chance.normal(size=6)
        if self._has('step'):
            wrench += self.step_of_force
        if self._has('hand'):
            wrench[:3] += 20.0 * np.sin(self.tick * self.T * np.array((3.0, 5.0, 7.0)))
        frame = 'nose' if self._has('no such frame') and chance.random() < 0.3 else ''
        measured = np.concatenate((R.T @ wrench[:3], R.T @ wrench[3:]))
        if self._has('NaN') and chance.random() < 0.3:
            measured[int(chance.integers(6))] = chance.choice((np.nan, np.inf))
        with suppress(RedresError):
            self.loop.measurements.enter_wrench(0, measured, frame)
        if self._has('torques'):
            torques = 30.0 * chance.normal(size=self.model.n)
            self.loop.measurements.enter('external_torques', 0, torques)

    def happen(self, name: str) -> None:
        self.disturbances[name] = self.tick + int(self.chance.geometric(1.0 / 100.0))
        if name == 'step':
            self.step_of_force = self.chance.choice(STEPS) * self.chance.normal(size=6)
        elif name == 'settings':
            self.change_settings()
        elif name == 'tare':
            with suppress(RedresError):
                self.loop.tare()
        elif name == 'hold':
            self.loop.hold(True)
            self._note_mode()
            self.run(int(self.chance.integers(0, 100)))
            self.loop.hold(False)
        elif name in DISTURBANCES:
            DISTURBANCES[name](self)
        self.run(int(self.chance.integers(10, 200)))

    def change_settings(self) -> None:
        """Any settings, within their ranges."""
        chance = self.chance
        rows = self.controller.m
        with suppress(RedresError):
            self.settings = replace(
                self.settings,
                enabled=bool(chance.random() < 0.8),
                frame=str(chance.choice(('base', 'tip', self.model.elbow_frame))),
                mass=tuple(chance.choice((0.0, 1.0, 50.0)) * chance.random(rows)),
                damping=tuple(10.0 ** chance.uniform(0.0, 5.0, rows)),
                stiffness=tuple(chance.choice((0.0, 1e2, 1e5)) * chance.random(rows)),
                force=tuple(chance.choice((0.0, 20.0, 1e3)) * chance.uniform(-1.0, 1.0, rows)),
                force_limit=float(chance.choice((5.0, 100.0, 1e4))),
            )
            self.contact.set_settings(self.settings)
            self.loop.hold(False)


SENSED = ('spikes', 'step', 'hand', 'NaN', 'drop-out', 'no such frame', 'torques')
CONTACTS = (*SENSED, 'settings', 'tare', 'law switch', 'limit change', 'hold')


def world_after(seed: int, names: tuple[str, ...]) -> ContactWorld:
    """A world in which enough of that has happened without a violation."""
    world = ContactWorld(seed)
    world.run(100)
    while world.judge.judged < TICKS / WORLDS:
        world.happen(str(world.chance.choice(names)))
        assert not world.judge.violations, world.judge.violations[:3]
    return world


@pytest.mark.parametrize('seed', SEEDS)
def test_no_wrench_and_no_change_in_contact_leaves_a_limit_or_makes_the_gate_act(seed: int) -> None:
    world = world_after(seed, CONTACTS)
    world.judge.assert_followable()
    assert 'moving' in world.judge.modes
    assert world.loop.safety_filter.count == 0


@pytest.mark.nightly
@pytest.mark.parametrize('seed', SEEDS)
def test_lost_states_stalls_and_sessions_in_contact_never_make_a_step(seed: int) -> None:
    world_after(seed, (*CONTACTS, *DISTURBANCES))
