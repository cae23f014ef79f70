"""Admittance: a task velocity that yields to the measured force like a mass, damper and spring."""

import numpy as np

from redres_ros.command import Command
from redres_ros.contact.settings import BASE, TIP, AdmittanceSettings, as_array
from redres_ros.interpolation import quintic
from redres_ros.robot_model import RobotState

AT_REST = 1e-6  # [m/s], [rad/s] of a yielding motion that is none


class Admittance:
    """dx = dx_d + de, with M dde + D de + K e = f - f_d in each direction of a frame, e = x - x_d.

    Implicit Euler, stable for every mass, also none:

        de_k = (M/T + D + K T)^-1 (M/T de_{k-1} + f - f_d - K e_{k-1})

    K > 0, f_d = 0 is an impedance; K = 0, f_d not 0 controls the force in that direction. Changes
    of the settings, on and off, are faded: none is a jump.

    Args:
        settings: Initial settings.
        T: Sampling time [s].
        switch_time: Duration of a fade [s]; 0: at once.
    """

    def __init__(self, settings: AdmittanceSettings, T: float, *, switch_time: float = 0.0) -> None:
        settings.check(len(settings.damping), T)
        self.T = T
        self.switch_time = switch_time
        self.settings = settings  # the requested ones
        self.restart()

    def restart(self) -> None:
        """Restart from rest, at x = x_d; the admittance is faded in again."""
        self._old: AdmittanceSettings | None = None  # that are faded out; None: it was off
        self._new: AdmittanceSettings | None = None
        self._faded = 1.0  # fraction of the fade that is over
        m = len(self.settings.damping)
        self.e = np.zeros(m)  # x - x_d in the base frame, (m,) [m], [rad]
        self._de = np.zeros(m)  # its velocity in the last tick, (m,)

    def rest(self) -> None:
        """The arm is at rest, where it is."""
        self._de = np.zeros(len(self._de))

    @property
    def is_on(self) -> bool:
        """Whether it acts, or will."""
        return self.settings.enabled or self._new is not None or self._old is not None

    @property
    def moves(self) -> bool:
        """Whether the tip yielded in the last tick."""
        return bool((np.abs(self._de) > AT_REST).any())

    def set_settings(self, settings: AdmittanceSettings) -> None:
        """Go over to other settings; during a fade they wait for its end.

        Raises ArrayError or RangeError for some that do not suit the task or the contact; those in
        force then stay.
        """
        settings.check(len(self.settings.damping), self.T)
        self.settings = settings

    def rate(self, wrench: np.ndarray, state: RobotState) -> np.ndarray:
        """de of this tick in the base frame, (m,) [m/s], [rad/s].

        Args:
            wrench: Force and moment that the environment exerts on the tip, in the axes of the
                base, (6,) [N], [Nm].
            state: State of the arm.
        """
        self._advance()
        new = self._rate_of(self._new, wrench, state)
        if self._faded >= 1.0:
            return new
        c, _ = quintic(self._faded)
        return (1.0 - c) * self._rate_of(self._old, wrench, state) + c * new

    def velocity(self, dx: np.ndarray, wrench: np.ndarray, state: RobotState) -> np.ndarray:
        """dx_d + de, (m,): the task velocity for the controller; then call record().

        Args:
            dx: Desired task velocity dx_d, (m,) [m/s], [rad/s].
            wrench: See rate().
            state: State of the arm.
        """
        return dx + self.rate(wrench, state)

    def record(self, command: Command, dx: np.ndarray) -> None:
        """Record what was executed: limits may have slowed it down.

        Args:
            command: Command of the controller at this tick.
            dx: Desired task velocity dx_d, of which the limits leave the fraction s, (m,).
        """
        self._de = command.J @ command.dq - command.s * dx
        self.e = self.e + self.T * self._de
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
        self, settings: AdmittanceSettings | None, wrench: np.ndarray, state: RobotState
    ) -> np.ndarray:
        """What settings ask for, (m,), under a wrench as of rate(); nothing while it is off."""
        if settings is None:
            return np.zeros(len(self.e))
        R = _rotation(settings.frame, state)
        f = _turned(R.T, wrench[: len(self.e)])
        e = _turned(R.T, self.e)
        de = _turned(R.T, self._de)
        mass = as_array(settings.mass) / self.T
        damping = as_array(settings.damping)
        stiffness = as_array(settings.stiffness)
        resistance = mass + damping + stiffness * self.T
        force = mass * de + f - as_array(settings.force) - stiffness * e
        return _turned(R, force / resistance)


def desired_force(settings: AdmittanceSettings, state: RobotState) -> np.ndarray:
    """f_d in the axes of the base, (3,) [N].

    Args:
        settings: Its frame counts.
        state: State of the arm.
    """
    return _rotation(settings.frame, state) @ as_array(settings.force[:3])


def _rotation(frame: str, state: RobotState) -> np.ndarray:
    """Orientation (3, 3) of the frame of the directions."""
    if frame == BASE:
        return np.eye(3)
    return state.rotation('' if frame == TIP else frame)


def _turned(R: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """A vector (3,), or two of them (6,), from the axes of the orientation R (3, 3) into others."""
    return (vector.reshape(-1, 3) @ R.T).reshape(-1)
