"""A million ticks of the loop between robot and controller, with random pairs of disturbances.

Pure, in virtual time: an ideal robot, its session, and the network to
the loop. Judged on what is published. By day a sample of it, with REDRES_NIGHTLY=1 all.
"""

from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import combinations
from typing import NamedTuple

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='the judge listens to ROS 2: pip install .[test]')

from nightly import NIGHTLY
from reference_judge import ReferenceJudge

from redres_ros import LAWS, Controller, RobotModel
from redres_ros.errors import RedresError
from redres_ros.loop.command_loop import CommandLoop
from redres_ros.robots import find_arm
from redres_ros.robots.joint_limits import JointLimits

pytestmark = pytest.mark.slow

TICKS = 1_000_000 if NIGHTLY else 20_000
ARMS = ('lwr4_paper', 'iiwa7', 'fr3', 'gen3', 'planar4r')
RATES = (100.0, 250.0, 500.0, 1000.0)  # [Hz]
EPOCH = 10**15  # [ns] of the first stamp
BRIDGED = 20  # cycles without a command after which a robot that extrapolates ends its session
KEPT = 16  # task velocities that a stalled process finds when it goes on
LIMIT_SETS = (
    ('position', 'velocity', 'acceleration'),
    ('position', 'velocity', 'acceleration', 'torque'),
    ('position', 'velocity', 'acceleration', 'jerk'),
)
CLOCK_STEPS = (-3600.0, -0.5, -0.02, 0.02, 0.5, 3600.0)  # [s]
LAW_NAMES = tuple(LAWS)


class Twist(NamedTuple):
    """A task velocity on its way: the tick in which it arrives, its stamp [ns], and itself (m,)."""

    due: int
    stamp: int
    dx: np.ndarray


@dataclass
class Robot:
    """Follows its commands; bridges a cycle without a command."""

    q: np.ndarray  # where the arm is, (n,) [rad]
    limits: JointLimits
    holds: bool  # stays at the last command; else it goes on, and then ends its session
    commanding: bool = True
    newest: np.ndarray | None = None  # command since the last cycle, (n,) [rad]
    last: np.ndarray | None = None  # command that came last, (n,) [rad]
    missed: int = 0  # cycles in a row without a command
    velocity: np.ndarray = field(init=False)  # (n,) [rad] a cycle

    def __post_init__(self) -> None:
        self.velocity = np.zeros_like(self.q)

    def advance(self) -> None:
        before = self.q
        if self.newest is not None:
            self.last = self.newest
        if not self.commanding:
            self.velocity = np.zeros_like(before)
        elif self.newest is not None:
            self.missed = 0
            self.q = self.newest
            self.velocity = self.q - before
        elif self.holds:
            self.velocity = np.zeros_like(before)
        else:
            self.missed += 1
            lower = np.minimum(self.limits.lower, before)
            upper = np.maximum(self.limits.upper, before)
            self.q = np.clip(before + self.velocity, lower, upper)
            self.commanding = self.missed < BRIDGED
        self.newest = None


class World:
    """A robot, its loop, an operator, and what disturbs them."""

    def __init__(self, seed: int) -> None:
        self.chance = np.random.default_rng(seed)
        chance = self.chance
        arm = find_arm(ARMS[seed % len(ARMS)])
        self.T = 1.0 / RATES[int(chance.integers(len(RATES)))]
        self.interface = ('ros2_control', 'fri')[int(chance.integers(2))]
        bridging = ('hold', 'extrapolate')[self.interface == 'fri']
        model = RobotModel(arm)
        self.controller = Controller(
            model,
            LAW_NAMES[int(chance.integers(len(LAW_NAMES)))],
            self.T,
            switch_time=0.2,
            limits=LIMIT_SETS[0],
            robot_interface=self.interface,
        )
        self.loop = CommandLoop(self.controller)
        limits = JointLimits.of(arm)
        self.robot = Robot(np.array(arm.start), limits, bridging == 'hold')
        self.judge = ReferenceJudge(limits, self.T, bridging)
        self.disturbances: dict[str, int] = {}  # until which tick
        self.tick = 0
        self._period = round(1e9 * self.T)
        self._stamps_begin = EPOCH
        self._clock_is_ahead = 0  # the robot's, of what the judge's shows [ns]
        self._twists: list[Twist] = []
        self._kept: deque[Twist] = deque(maxlen=KEPT)
        self._state: tuple[int, np.ndarray] | None = None  # that a stalled process finds
        self._reported = True  # whether the robot takes commands, as the loop knows it
        self._session_returns = 0
        self._wanted = np.full(self.controller.m, 0.1)
        self._dx = np.zeros(self.controller.m)
        self._dense = bool(chance.integers(2))  # a planner; else an operator

    # --- one cycle ---

    def step(self) -> None:
        self.tick += 1
        self.robot.advance()
        self._report_session()
        stamp = self._stamps_begin + self.tick * self._period
        self._move_operator(stamp)
        if self._has('stall'):
            self._state = (stamp, self.robot.q)
            self._kept.extend(self._arriving())
            return
        if self._has('lost states') and self.chance.random() < 0.4:
            self._state = None
        else:
            self._state = (stamp, self.robot.q)
        if self._state is not None:
            self._enter_state(*self._state)
        for twist in (*self._kept, *self._arriving()):
            self._enter_twist(twist)
        self._kept.clear()

    def _has(self, disturbance: str) -> bool:
        return self.disturbances.get(disturbance, 0) > self.tick

    def _now(self) -> float:
        return 1000.0 + self.tick * self.T

    def _enter_state(self, stamp: int, q: np.ndarray) -> None:
        self.judge.enter_state(stamp, q)
        response = None
        with suppress(RedresError):  # a state that is refused has no response
            response = self.loop.step(stamp + self._clock_is_ahead, q, self._now())
        self._note_mode()
        if response is None:
            return
        self.judge.enter_reference(stamp, response.command.q_ref)
        self.loop.sent = self._now()
        self.robot.newest = response.command.q_ref

    def _enter_twist(self, twist: Twist) -> None:
        with suppress(RedresError):  # too old
            self.loop.enter_velocity(twist.stamp, twist.dx, self._now())

    def _note_mode(self) -> None:
        word = self.loop.mode.value
        if word != self.judge.mode:
            self.judge.enter_mode(word)

    # --- who steers ---

    def _move_operator(self, stamp: int) -> None:
        """Change what is wanted now and then; send it."""
        chance = self.chance
        if chance.random() < 2.0 * self.T:
            self._wanted = chance.choice((0.0, 0.1, 0.5, 1.5)) * chance.normal(size=len(self._dx))
            self._wanted *= chance.random() > 0.2
        change = self._wanted - self._dx
        self._dx = self._dx + np.clip(change, -2.0 * self.T, 2.0 * self.T)
        if not self._dense and self.tick % max(round(0.02 / self.T), 1):
            return
        dx = self._dx if self._dense else self._wanted
        if np.linalg.norm(dx[:3]) > 1.9:
            dx = dx / np.linalg.norm(dx[:3])
        delay = int(chance.integers(1, 30)) if self._has('late twists') else 0
        stamped = stamp + self._clock_is_ahead if self._dense else 0
        self._twists.append(Twist(self.tick + delay, stamped, dx))

    def _arriving(self) -> list[Twist]:
        due = [twist for twist in self._twists if twist.due <= self.tick]
        self._twists = [twist for twist in self._twists if twist.due > self.tick]
        return due

    # --- what disturbs ---

    def disturb(self, one: str, other: str) -> None:
        """Have two disturbances begin, one after the other, and wait until both are over."""
        chance = self.chance
        for name in (one, other):
            self.disturbances[name] = self.tick + int(chance.geometric(1.0 / 60.0))
            DISTURBANCES[name](self)
            self.run(int(chance.integers(0, 40)))
        self.run(int(chance.integers(40, 400)))

    def run(self, ticks: int) -> None:
        for _ in range(ticks):
            self.step()
            if self._has('law switch') and self.chance.random() < 0.1:
                self.switch_law()

    def switch_law(self) -> None:
        self.controller.switch_law(LAW_NAMES[int(self.chance.integers(len(LAW_NAMES)))])

    def change_limits(self) -> None:
        names = LIMIT_SETS[int(self.chance.integers(len(LIMIT_SETS)))]
        scale = float(self.chance.choice((1.0, 0.5, 0.1)))
        torque = float(self.chance.choice((1.0, 0.5, 0.2)))
        self.controller.set_limits(names, limit_scale=scale, torque_scale=torque)

    def set_clock(self) -> None:
        """Set the robot's clock back or forward; by little not while states get lost, as a state
        of a clock that was set back by what is missing looks like one that is late.
        """
        step = float(self.chance.choice(CLOCK_STEPS))
        if abs(step) < 0.1 and (self._has('lost states') or self._has('stall')):
            step *= 1000.0
        self._clock_is_ahead += round(1e9 * step)

    def end_session(self) -> None:
        self.robot.commanding = False

    def _report_session(self) -> None:
        """Report the session to the loop; it returns after a while."""
        robot = self.robot
        if robot.commanding is not self._reported and not self._has('stall'):
            self._reported = robot.commanding
            self.loop.enter_session('CMD' if robot.commanding else 'MON')
            self._session_returns = self.tick + int(self.chance.integers(20, 200))
        returns = not robot.commanding and not self._reported and self.tick > self._session_returns
        # A first command has to come from where the arm is.
        if returns and robot.last is not None and np.allclose(robot.last, robot.q, atol=1e-3):
            robot.commanding = True
            robot.missed = 0

    def restart(self) -> None:
        """Deactivate the controller, and activate it again; or start the robot anew."""
        if self.chance.random() < 0.5:
            self.loop.deactivate()
            self._note_mode()
            self.run(int(self.chance.integers(0, 100)))
            self.loop.activate()
            return
        self.robot.velocity[:] = 0.0
        self.robot.newest = None
        self.tick += round(0.7 / self.T)  # silence
        self._stamps_begin += 10 * 10**9
        self.judge.forget()


DISTURBANCES: dict[str, Callable[[World], None]] = {
    'lost states': lambda world: None,
    'late twists': lambda world: None,
    'stall': lambda world: None,
    'law switch': World.switch_law,
    'limit change': World.change_limits,
    'clock set': World.set_clock,
    'session change': World.end_session,
    'restart': World.restart,
}
PAIRS = tuple(combinations(DISTURBANCES, 2))
WORLDS = 100 if NIGHTLY else 6


@pytest.mark.parametrize('seed', range(WORLDS))
def test_random_pairs_of_disturbances_never_make_a_step(seed: int) -> None:
    world = World(seed)
    world.run(200)
    while world.judge.judged < TICKS / WORLDS:
        pair = PAIRS[int(world.chance.integers(len(PAIRS)))]
        world.disturb(*pair)
        assert not world.judge.violations, (pair, world.judge.violations[:3])


@pytest.mark.parametrize('seed', range(WORLDS))
def test_undisturbed_the_gate_never_acts(seed: int) -> None:
    world = World(seed)
    world.run(TICKS // WORLDS)
    world.judge.assert_followable()
    assert 'moving' in world.judge.modes
    assert world.loop.safety_filter.count == 0
    assert world.loop.error == ''
