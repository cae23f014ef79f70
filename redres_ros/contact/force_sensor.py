"""The wrench at the tip from what a sensor measures: bias, payload, filter, and whether it can be
believed.
"""

from collections import deque
from typing import NamedTuple

import numpy as np

from redres_ros.contact.settings import AdmittanceSettings, as_array
from redres_ros.errors import RedresError
from redres_ros.robot_model import RobotState

_GRAVITY = np.array((0.0, 0.0, -9.81))  # [m/s^2] in the base frame
_TARED = 100  # wrenches whose mean a tare takes
_FEWEST = 10
_IMPOSSIBLE = 1e9  # [N], [Nm]; squares of much more would overflow


class TareError(RedresError):
    """A tare that cannot be made."""


class _RawWrench(NamedTuple):
    """A wrench as it came: the link in whose axes and about whose origin it is, and (6,)."""

    frame: str
    wrench: np.ndarray


class ForceSensor:
    """Turns measured wrenches into force and moment of the environment on the tip.

    Args:
        settings: Payload, filter, range and timeout; may be replaced at any time.
        T: Sampling time [s].
    """

    def __init__(self, settings: AdmittanceSettings, T: float) -> None:
        self.settings = settings
        self._T = T
        self._bias = np.zeros(6)  # in the axes of the sensor
        self._recent: deque[_RawWrench] = deque(maxlen=_TARED)
        self._age = np.inf  # [s]
        self._filtered: np.ndarray | None = None

    def enter(self, wrench: np.ndarray, frame: str = '') -> None:
        """Record a measured wrench.

        Args:
            wrench: Force and moment that the environment exerts, (6,) [N], [Nm].
            frame: The link along whose axes and about whose origin they are; '' is the tip.
        """
        measured = _RawWrench(frame, np.array(wrench, dtype=np.float64))
        if self._recent and self._recent[-1].frame != frame:
            self._recent.clear()
        self._recent.append(measured)
        self._age = 0.0

    def advance(self, cycles: int) -> None:
        """Advance the age of the wrench by some cycles."""
        self._age += cycles * self._T

    @property
    def problem(self) -> str:
        """Why the wrench cannot be used; '' if it can."""
        settings = self.settings
        if not self._age <= settings.wrench_timeout:
            return f'no wrench for {settings.wrench_timeout:g} s (admittance.wrench_timeout)'
        raw = self._recent[-1].wrench
        largest = float(np.abs(raw).max())
        if not largest < _IMPOSSIBLE:
            return f'the wrench is {raw.tolist()}; expected finite values below {_IMPOSSIBLE:g}'
        if settings.sensor_range and largest >= settings.sensor_range:
            return (
                f'the wrench is saturated: {largest:g} N, at the end of its range of '
                f'{settings.sensor_range:g} (admittance.sensor_range)'
            )
        return ''

    def at_tip(self, state: RobotState) -> np.ndarray:
        """Force and moment about the tip in the axes of the base, (6,) [N], [Nm]; once a tick, if a
        usable wrench has come.
        """
        measured = self._recent[-1]
        wrench = _to_tip(measured.wrench - self._bias, measured.frame, state)
        wrench = wrench - self._payload(state)
        if self._filtered is not None:
            tau = self.settings.filter_time
            wrench = self._filtered + self._T / (tau + self._T) * (wrench - self._filtered)
        self._filtered = wrench
        return wrench

    def restart(self) -> None:
        """Forget the filter's past."""
        self._filtered = None

    def tare(self, state: RobotState) -> None:
        """Take what is measured now, beyond the payload's weight, for the sensor's bias.

        The arm is at rest and touches nothing. Raises TareError for a wrench that cannot be used.
        """
        if self.problem:
            raise TareError(self.problem)
        if len(self._recent) < _FEWEST:
            raise TareError(f'{len(self._recent)} wrenches have come; expected {_FEWEST} or more')
        mean = np.mean([measured.wrench for measured in self._recent], axis=0)
        if not np.isfinite(mean).all():
            raise TareError('some of the last wrenches are not finite')
        self._bias = mean - _from_tip(self._payload(state), self._recent[-1].frame, state)
        self._filtered = None

    def _payload(self, state: RobotState) -> np.ndarray:
        """The payload's weight as force and moment about the tip, (6,), in the base's axes."""
        weight = self.settings.payload_mass * _GRAVITY
        lever = state.R @ as_array(self.settings.payload_center)
        return np.concatenate((weight, np.cross(lever, weight)))


def _to_tip(wrench: np.ndarray, frame: str, state: RobotState) -> np.ndarray:
    """A wrench (6,) about the tip in the axes of the base, of one about a link's origin in its
    own axes; '' is the tip.
    """
    x, R = state.pose(frame)
    force = R @ wrench[:3]
    moment = R @ wrench[3:] + np.cross(x - state.x, force)
    return np.concatenate((force, moment))


def _from_tip(wrench: np.ndarray, frame: str, state: RobotState) -> np.ndarray:
    """The reverse of _to_tip()."""
    x, R = state.pose(frame)
    force = wrench[:3]
    moment = wrench[3:] - np.cross(x - state.x, force)
    return np.concatenate((R.T @ force, R.T @ moment))
