"""Admittance: a task velocity that yields to the measured force like a mass, damper and spring."""

from dataclasses import dataclass
from functools import partial
from typing import Self

import numpy as np

from redres_ros.command import Command
from redres_ros.errors import ArrayError, RangeError
from redres_ros.geometry import quintic
from redres_ros.parameter import check_parameters, param
from redres_ros.robot_model import RobotState
from redres_ros.types import Rotation, Seconds, TaskVelocity, Wrench

BASE = 'base'
TIP = 'tip'
AT_REST = 1e-6  # [m/s], [rad/s] of a yielding motion that is none

_live = partial(param, live=True)


@dataclass(frozen=True)
class AdmittanceSettings:
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
        check_parameters(self)
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

    def desired_force(self, state: RobotState) -> np.ndarray:
        """f_d in the axes of the base, (3,) [N]."""
        return self._rotation(state) @ np.array(self.force[:3])

    def rate(
        self, wrench: Wrench, e: np.ndarray, de: TaskVelocity, T: Seconds, state: RobotState
    ) -> TaskVelocity:
        """The next de, for e (m,), the last de and a wrench, all in the axes of the base."""
        R = self._rotation(state)
        f = _turned(R.T, wrench[: len(e)])
        e = _turned(R.T, e)
        mass = np.array(self.mass) / T
        stiffness = np.array(self.stiffness)
        resistance = mass + np.array(self.damping) + stiffness * T
        force = mass * _turned(R.T, de) + f - np.array(self.force) - stiffness * e
        return _turned(R, force / resistance)

    def _rotation(self, state: RobotState) -> Rotation:
        """Of the frame of the directions."""
        if self.frame == BASE:
            return np.eye(3)
        return state.rotation('' if self.frame == TIP else self.frame)


class Admittance:
    """dx = dx_d + de, with M dde + D de + K e = f - f_d in each direction of a frame, e = x - x_d.

    Implicit Euler, stable for every mass, also none:

        de_k = (M/T + D + K T)^-1 (M/T de_{k-1} + f - f_d - K e_{k-1})

    K > 0, f_d = 0 is an impedance; K = 0, f_d not 0 controls the force in that direction. Changes
    of the settings, on and off, are faded over the switch time [s]: none is a jump.
    """

    def __init__(
        self, settings: AdmittanceSettings, T: Seconds, *, switch_time: Seconds = 0.0
    ) -> None:
        self.T = T
        self.switch_time = switch_time
        self.settings = settings  # the requested ones; during a fade they wait for its end
        self.restart()

    def restart(self) -> None:
        """Restart from rest, at x = x_d; the admittance is faded in again."""
        self._old: AdmittanceSettings | None = None  # that are faded out; None: it was off
        self._new: AdmittanceSettings | None = None
        self._faded = 1.0  # fraction of the fade that is over
        m = len(self.settings.damping)
        self.e = np.zeros(m)  # x - x_d in the base frame, (m,) [m], [rad]
        self.de = np.zeros(m)  # its velocity in the last tick, (m,)

    @property
    def is_on(self) -> bool:
        """Whether it acts, or will."""
        return self.settings.enabled or self._new is not None or self._old is not None

    def rate(self, wrench: Wrench, state: RobotState) -> TaskVelocity:
        """de of this tick in the base frame, for the wrench that the environment exerts on the tip,
        in the axes of the base.
        """
        self._advance()
        new = self._rate_of(self._new, wrench, state)
        if self._faded >= 1.0:
            return new
        c, _ = quintic(self._faded)
        return (1.0 - c) * self._rate_of(self._old, wrench, state) + c * new

    def record(self, command: Command, dx: TaskVelocity) -> None:
        """Record what was executed of the desired dx_d and of de: limits may have slowed it."""
        self.de = command.J @ command.dq - command.s * dx
        self.e = self.e + self.T * self.de
        if not self.is_on:
            self.e = np.zeros(len(self.e))

    def _advance(self) -> None:
        """Advance a fade by one cycle; begin one if other settings are asked for."""
        if self._faded >= 1.0:
            self._old = None
            desired = self.settings if self.settings.enabled else None
            if desired == self._new:
                return
            self._old = self._new
            self._new = desired
            self._faded = 0.0
        self._faded += self.T / self.switch_time if self.switch_time > 0.0 else 1.0

    def _rate_of(
        self, settings: AdmittanceSettings | None, wrench: Wrench, state: RobotState
    ) -> TaskVelocity:
        if settings is None:  # off
            return np.zeros(len(self.e))
        return settings.rate(wrench, self.e, self.de, self.T, state)


def _turned(R: Rotation, vector: np.ndarray) -> np.ndarray:
    """A vector (3,), or two of them (6,), from the axes of the orientation R into others."""
    return (vector.reshape(-1, 3) @ R.T).reshape(-1)
