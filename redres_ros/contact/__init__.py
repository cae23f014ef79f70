"""Contact: impedance and force through a position interface, and reactions to faults.

| event | reaction |
|---|---|
| a wrench that is stale or not finite | hold |
| a force above `force_limit` | retreat along it until another opposes it or it grows, then hold |
| no contact while force is asked for | search, bounded in speed and distance, then hold |

The pure part: no ROS, usable beside a Controller in any closed loop.
"""

from collections import deque
from dataclasses import dataclass
from functools import partial
from typing import Self

import numpy as np

from redres_ros.command import Command
from redres_ros.errors import ArrayError, RangeError, RedresError
from redres_ros.geometry import quintic, rotation_matrix
from redres_ros.kernels.tick import rotation_error
from redres_ros.parameter import Checked, param
from redres_ros.robot_model import RobotState
from redres_ros.types import Cycles, Rotation, Seconds, TaskVelocity, Wrench

BASE = 'base'
TIP = 'tip'
_AT_REST = 1e-6  # [m/s], [rad/s] of a yielding motion that is none
_live = partial(param, live=True)

# A robot's own workspace and speed limits allow these, and a surface takes a dent of them.
_SEARCH_SPEED = 0.02  # [m/s], largest at which a contact is approached
_SEARCH_DISTANCE = 0.05  # [m] after which an approach without contact ends
_RETREAT_SPEED = 0.02  # [m/s]
_RETREAT_DISTANCE = 0.01  # [m]
_RETREAT_TIME = 3.0  # times what it takes at full speed, after which a retreat ends anyway
_GROWN = 1.1  # times the force where the tip turns round, and 1 N, at which a retreat ends
_OPPOSED = 0.2  # of the force limit, against a retreat, at which it ends
_TOUCHES = 0.25  # of the desired force, which counts as contact
_TARED = 100  # wrenches whose median a tare takes, in which one glitch does not count
_FEWEST = 10
_IMPOSSIBLE = 1e9  # [N], [Nm]; squares of much more would overflow


@dataclass(frozen=True)
class AdmittanceSettings(Checked):
    """Mass, damping, stiffness and desired force for each direction, and when the arm stops.

    Arrays have 3 values for a task velocity of 3 rows, 6 for one of 6: three directions, and the
    rotations about them.

    Raises:
        RangeError: A value that is not allowed, or a direction without mass, damping and stiffness.
        ArrayError: Arrays of different or other lengths.
    """

    enabled: bool = _live(False, 'yield to the measured wrench')
    frame: str = _live(BASE, 'frame of the directions: base, tip or the name of a link')
    mass: tuple[float, ...] = _live((0.0,) * 3, 'M_d [kg], [kg m^2]; 0: pure damping', 0.0, 1e4)
    damping: tuple[float, ...] = _live((1000.0,) * 3, 'D_d [N s/m], [Nm s/rad]', 0.0, 1e6)
    stiffness: tuple[float, ...] = _live(
        (0.0,) * 3, 'K_d [N/m], [Nm/rad]; 0: no return to the commanded path', 0.0, 1e6
    )
    force: tuple[float, ...] = _live(
        (0.0,) * 3, 'f_d, desired force and moment of the environment [N], [Nm]', -1e3, 1e3
    )
    force_limit: float = _live(
        100.0, 'force above which the tip retreats and the arm holds [N]', 1.0, 1e4
    )
    wrench_timeout: float = _live(
        0.05, 'age at which a wrench counts as stale and the arm holds [s]', 0.001, 10.0
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        rows = len(self.damping)
        for name in ('mass', 'damping', 'stiffness', 'force'):
            size = len(getattr(self, name))
            if size != rows or size not in (3, 6):
                raise ArrayError(f'{name} holds {size} values; expected 3 or 6, like damping')
        for row in range(rows):
            if not self.mass[row] + self.damping[row] + self.stiffness[row] > 0.0:
                name = f'damping of direction {row + 1}'
                raise RangeError(name, self.damping[row], 0.0, 1e6, 'not 0 alone')

    @classmethod
    def of_rows(cls, rows: int) -> Self:
        """The defaults for a task velocity of 3 or 6 rows."""
        if rows == 3:
            return cls()
        none = (0.0,) * rows
        damping = (1000.0, 1000.0, 1000.0, 50.0, 50.0, 50.0)
        return cls(mass=none, damping=damping, stiffness=none, force=none)

    def check(self, rows: int) -> None:
        """Raise ArrayError for settings of a task velocity with another number of rows."""
        if len(self.damping) != rows:
            raise ArrayError(
                f'damping holds {len(self.damping)} values; expected {rows}, as many as dx has'
            )

    def rate(
        self, wrench: Wrench, e: np.ndarray, de: TaskVelocity, T: Seconds, state: RobotState
    ) -> TaskVelocity:
        """The next de, for e (m,), the last de and a wrench, all in the axes of the base."""
        R = self.rotation(state)
        f = _turned(R.T, wrench[: len(e)])
        e = _turned(R.T, e)
        mass = np.array(self.mass) / T
        stiffness = np.array(self.stiffness)
        resistance = mass + np.array(self.damping) + stiffness * T
        force = mass * _turned(R.T, de) + f - np.array(self.force) - stiffness * e
        return _turned(R, force / resistance)

    def rotation(self, state: RobotState) -> Rotation:
        """Of the frame of the directions."""
        if self.frame == BASE:
            return np.eye(3)
        return state.pose('' if self.frame == TIP else self.frame)[1]


class ContactError(RedresError):
    """A contact that has gone wrong, so that the arm is to hold; or a tare that cannot be made."""


class _ForceSensor:
    """Turns measured wrenches into force and moment of the environment on the tip."""

    def __init__(self, timeout: Seconds, T: Seconds) -> None:
        self.timeout = timeout
        self._T = T
        self._bias = np.zeros(6)  # in the axes of the sensor
        self._tared = ''  # the frame of the bias
        self._recent: deque[Wrench] = deque(maxlen=_TARED)
        self._frame = ''  # the link in whose axes and about whose origin they are; '' is the tip
        self._age = 0.0  # [s], or for how long the first one has been awaited

    def enter(self, wrench: Wrench, frame: str = '') -> None:
        """Record a wrench from outside, about a link's origin and in its axes; '' is the tip."""
        if frame != self._frame:
            self._recent.clear()
            self._frame = frame
        self._recent.append(np.array(wrench, dtype=np.float64))
        self._age = 0.0

    def expect(self) -> None:
        """Wait for the first wrench from now on, if there is none that can be used."""
        if self.problem:
            self._recent.clear()
            self._age = 0.0

    def advance(self, cycles: Cycles) -> None:
        self._age += cycles * self._T

    @property
    def problem(self) -> str:
        """Why the wrench cannot be used; '' if it can."""
        if not self._age <= self.timeout:
            return f'no wrench for {self.timeout:g} s (admittance.wrench_timeout)'
        if self._recent and not float(np.abs(self._recent[-1]).max()) < _IMPOSSIBLE:
            raw = self._recent[-1].tolist()
            return f'the wrench is {raw}; expected finite values below {_IMPOSSIBLE:g}'
        if self._frame != self._tared and self._bias.any():
            frames = f'{self._tared or TIP} to {self._frame or TIP}'
            return f'its frame has changed from {frames} since the wrench was tared: tare it again'
        return ''

    def at_tip(self, state: RobotState) -> Wrench | None:
        """A usable wrench about the tip in the axes of the base; None before the first one."""
        if not self._recent:
            return None
        x, R = state.pose(self._frame)
        measured = self._recent[-1] - self._bias
        force = R @ measured[:3]
        moment = R @ measured[3:] + np.cross(x - state.x, force)
        return np.concatenate((force, moment))

    def tare(self) -> None:
        """Take what is measured now, at rest without contact, for the bias. Raises ContactError."""
        if not self._age <= self.timeout:
            raise ContactError(self.problem)
        recent = np.array(self._recent)
        if len(recent) < _FEWEST:
            raise ContactError(f'{len(recent)} wrenches have come; expected {_FEWEST} or more')
        if not np.abs(recent).max() < _IMPOSSIBLE:
            raise ContactError(f'some of the last wrenches are not finite, or {_IMPOSSIBLE:g}')
        self._bias = np.median(recent, axis=0)
        self._tared = self._frame


class ContactControl:
    """Admittance with its force sensor, and reactions to faults of contact: dx = dx_d + de, with
    M dde + D de + K e = f - f_d in each direction of a frame, e = x - x_d.

    Implicit Euler, stable for every mass, also none:

        de_k = (M/T + D + K T)^-1 (M/T de_{k-1} + f - f_d - K e_{k-1})

    K > 0, f_d = 0 is an impedance; K = 0, f_d not 0 controls the force in that direction. Changes
    of the settings, on and off, are faded over the switch time [s]: none is a jump.

    In a closed loop:

        contact.sensor.enter(wrench)
        velocity = contact.velocity(dx, state)
        command = controller.update(q, velocity)
        contact.record(command, dx)
    """

    def __init__(
        self, settings: AdmittanceSettings, T: Seconds, *, switch_time: Seconds = 0.0
    ) -> None:
        self.T = T
        self.switch_time = switch_time
        self.settings = settings  # the requested ones; during a fade they wait for its end
        self.sensor = _ForceSensor(settings.wrench_timeout, T)
        self.force = np.zeros(3)  # on the tip at the last tick, in the base frame, (3,) [N]
        self.restart()

    def restart(self) -> None:
        """Restart from rest, where the arm is, at x = x_d; the admittance is faded in again."""
        self._old: AdmittanceSettings | None = None  # that are faded out; None: it was off
        self._new: AdmittanceSettings | None = None  # that are faded in, or in force
        self._faded = 1.0  # fraction of the fade that is over
        m = len(self.settings.damping)
        self.e = np.zeros(m)  # x - x_d in the base frame, (m,) [m], [rad]
        self.de = np.zeros(m)  # its velocity in the last tick, (m,)
        self.warning = ''  # the reason of a retreat, and of the stop that follows
        self.retreat: np.ndarray | None = None  # direction, (3,)
        self._end = 0.0  # [m] along it
        self._turn = np.inf  # [m] along it, where the tip has turned round
        self._first = 0.0  # [N], the force there
        self._ticks = 0  # of the retreat
        self._searched = 0.0  # [m]
        self._toward = np.zeros(3)  # direction of a search under way, (3,)

    def set_settings(self, settings: AdmittanceSettings) -> None:
        """Go over to other settings without a jump, or raise ArrayError and keep the old ones."""
        settings.check(len(self.settings.damping))
        if settings.enabled and not self.settings.enabled:
            self.sensor.expect()
        self.settings = settings
        self.sensor.timeout = settings.wrench_timeout

    @property
    def is_on(self) -> bool:
        """Whether it acts, or will."""
        return self.settings.enabled or self._new is not None or self._old is not None

    def velocity(self, dx: TaskVelocity, state: RobotState, missed: Cycles = 0) -> TaskVelocity:
        """The task velocity dx_d + de, or that of a retreat; then call record().

        The state is as measured; `missed` cycles went without a call since the last one. Raises
        ContactError if the arm is to hold.
        """
        self.sensor.advance(missed + 1)
        if not self.is_on:
            return dx
        if problem := self.sensor.problem:
            raise ContactError(problem)
        wrench = self.sensor.at_tip(state)
        if wrench is None:
            return dx
        self.force = wrench[:3]
        if self.retreat is None and self._exceeds_limit():
            self.retreat = self.force / np.linalg.norm(self.force)
            self._end = float(state.x @ self.retreat) + _RETREAT_DISTANCE
        if self.retreat is not None:
            return self._retreating(self.retreat, state, len(dx))
        rate = self._rate(wrench, state)
        for settings in filter(None, (self._old, self._new)):  # what acts: a fade may be under way
            self._bound_search(rate, settings, state)
        return dx + rate

    def record(self, command: Command, dx: TaskVelocity) -> None:
        """Record what a command executed of dx_d and of de: limits may have slowed it."""
        if not self.is_on:
            self.e = np.zeros(len(self.e))
            return
        executed = command.J @ command.dq
        desired = command.s * dx
        self.de = executed - desired
        e = self.e + self.T * self.de
        if len(e) > 3:  # turns about different axes are composed: their vectors do not add up
            R = rotation_matrix(self.T * executed[3:]) @ rotation_matrix(self.e[3:])
            e[3:] = rotation_error(rotation_matrix(self.T * desired[3:]), R)
        self.e = e
        self._searched += self.T * float(executed[:3] @ self._toward)

    def asks(self, state: RobotState, missed: Cycles = 0, *, at_rest: bool = True) -> bool:
        """Whether an arm is to move, or to move on: a wrench or a desired force asks for it. At
        rest it is called in place of velocity().
        """
        if not at_rest:
            return self.retreat is not None or bool((np.abs(self.de) > _AT_REST).any())
        self.sensor.advance(missed + 1)
        if not self.settings.enabled:
            self.restart()
            return False
        wrench = None if self.sensor.problem else self.sensor.at_tip(state)
        if wrench is None:
            return False
        self.de = np.zeros(len(self.de))
        self.force = wrench[:3]
        rate = self._rate(wrench, state)
        return self._exceeds_limit() or bool((np.abs(rate) > _AT_REST).any())

    def _rate(self, wrench: Wrench, state: RobotState) -> TaskVelocity:
        """de of this tick in the base frame; a fade goes on, or begins if settings have changed."""
        if self._faded >= 1.0:
            self._old = self._new
            self._new = self.settings if self.settings.enabled else None
            self._faded = float(self._new == self._old)
        if self._faded < 1.0:
            self._faded += self.T / self.switch_time if self.switch_time > 0.0 else 1.0
        c, _ = quintic(self._faded)
        rate = np.zeros(len(self.e))
        for settings, fraction in ((self._old, 1.0 - c), (self._new, c)):
            if settings is not None and fraction > 0.0:
                rate += fraction * settings.rate(wrench, self.e, self.de, self.T, state)
        return rate

    def _exceeds_limit(self) -> bool:
        """Whether the force is above its limit; then the warning says so."""
        size = float(np.linalg.norm(self.force))
        limit = self.settings.force_limit
        self.warning = ''
        if size > limit:
            self.warning = (
                f'a force of {size:.4g} N on the tip, allowed {limit:g} (admittance.force_limit)'
            )
        return size > limit

    def _retreating(self, direction: np.ndarray, state: RobotState, rows: int) -> TaskVelocity:
        """The velocity of a retreat along (3,). Raises ContactError once it is over."""
        usual = _RETREAT_DISTANCE / (_RETREAT_SPEED * self.T)  # ticks
        size = float(np.linalg.norm(self.force))
        reached = float(state.x @ direction)
        if reached <= self._turn:
            self._turn = reached
            self._first = max(self._first, size)
        self._ticks += 1
        if reached >= self._end or self._ticks > _RETREAT_TIME * usual:
            raise ContactError(f'{self.warning}: the tip has retreated')
        opposed = -float(self.force @ direction)
        if size > _GROWN * self._first + 1.0 or opposed > _OPPOSED * self.settings.force_limit:
            raise ContactError(f'{self.warning}: the retreat met a force of {size:.4g} N')
        velocity = np.zeros(rows)
        velocity[:3] = _RETREAT_SPEED * direction
        return velocity

    def _bound_search(
        self, rate: TaskVelocity, settings: AdmittanceSettings, state: RobotState
    ) -> None:
        """Bound speed and distance of a search. Raises ContactError if it found no contact."""
        desired = settings.rotation(state) @ np.array(settings.force[:3])  # (3,) [N]
        size = float(np.linalg.norm(desired))
        if size == 0.0 or float(self.force @ desired) > _TOUCHES * size**2:
            self._searched = 0.0
            self._toward = np.zeros(3)
            return
        if self._searched > _SEARCH_DISTANCE:
            raise ContactError(
                f'no contact within {_SEARCH_DISTANCE:g} m while {size:g} N are asked for'
            )
        self._toward = -desired / size  # the tip pushes against the environment
        excess = float(rate[:3] @ self._toward) - _SEARCH_SPEED
        if excess > 0.0:
            rate[:3] -= excess * self._toward


def _turned(R: Rotation, vector: np.ndarray) -> np.ndarray:
    """A vector (3,), or two of them (6,), from the axes of the orientation R into others."""
    return (vector.reshape(-1, 3) @ R.T).reshape(-1)
