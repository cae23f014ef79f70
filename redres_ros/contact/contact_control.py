"""Admittance with its force sensor, and reactions to faults of contact.

| event | reaction |
|---|---|
| a wrench that is stale, not finite or saturated | hold |
| a force above `force_limit` | retreat along the force, then hold |
| no contact while force is asked for | search, bounded in speed and distance, then hold |
"""

from dataclasses import replace

import numpy as np

from redres_ros.command import Command
from redres_ros.contact.admittance import AT_REST, Admittance, desired_force
from redres_ros.contact.force_sensor import ForceSensor
from redres_ros.contact.settings import AdmittanceSettings
from redres_ros.errors import RedresError
from redres_ros.robot_model import RobotState

_TOUCHES = 0.25  # of the desired force, which counts as contact
_RETREAT_TIME = 3.0  # times what it takes at full speed, after which a retreat ends anyway


class ContactError(RedresError):
    """A contact that has gone wrong: the arm is to hold."""


class PayloadError(RedresError):
    """A payload that is changed while the admittance relies on it."""


class ContactControl:
    """Admittance, sensor and reactions for one arm.

    In a closed loop:

        contact.sensor.enter(wrench)
        velocity = contact.velocity(dx, state)
        command = controller.update(q, velocity)
        contact.record(command, dx)

    Args:
        settings: Initial settings.
        T: Sampling time [s].
        switch_time: Duration of a fade [s]; 0: at once.
    """

    def __init__(self, settings: AdmittanceSettings, T: float, *, switch_time: float = 0.0) -> None:
        self.sensor = ForceSensor(settings, T)
        self.admittance = Admittance(settings, T, switch_time=switch_time)
        self.force = np.zeros(3)  # on the tip at the last tick, in the base frame, (3,) [N]
        self._T = T
        self.restart()

    @property
    def settings(self) -> AdmittanceSettings:
        """The requested ones."""
        return self.admittance.settings

    @property
    def is_on(self) -> bool:
        """Whether the arm yields."""
        return self.admittance.is_on

    @property
    def moves(self) -> bool:
        """Whether the last tick yielded to something, or retreated."""
        return self.is_on and (self.retreats or self.admittance.moves)

    @property
    def retreats(self) -> bool:
        """Whether the tip retreats."""
        return self._retreat is not None

    def set_settings(self, settings: AdmittanceSettings) -> None:
        """Go over to other settings, without a jump. Raises RedresError; the old ones then stay."""
        self.check(settings)
        self.admittance.set_settings(settings)
        self.sensor.settings = settings

    def check(self, settings: AdmittanceSettings) -> None:
        """Raise RedresError for settings that it would refuse."""
        before = self.settings
        settings.check(len(before.damping), self._T)
        same = replace(
            settings, payload_mass=before.payload_mass, payload_center=before.payload_center
        )
        if self.is_on and same != settings:
            raise PayloadError(
                'the payload changes the force at once; set admittance.enabled to false first'
            )

    def restart(self) -> None:
        """Restart from rest, where the arm is."""
        self.admittance.restart()
        self.sensor.restart()
        self.warning = ''  # the reason of a retreat, and of the stop that follows
        self._searched = 0.0  # [m]
        self._retreat: np.ndarray | None = None  # direction, (3,)
        self._left = 0.0  # [m] of the retreat
        self._ticks = 0  # of the retreat
        self._toward = np.zeros(3)  # direction of a search under way, (3,)

    def velocity(self, dx: np.ndarray, state: RobotState, missed: int = 0) -> np.ndarray:
        """The task velocity dx_d + de, or that of a retreat, (m,); then call record().

        Args:
            dx: Desired task velocity dx_d, (m,) [m/s], [rad/s].
            state: State of the arm, as measured.
            missed: Cycles since the last call that went without one.

        Raises:
            ContactError: The arm is to hold, for the reason in the error.
        """
        self.sensor.advance(missed + 1)
        if not self.is_on:
            return dx
        if self._retreat is not None:
            return self._retreating(self._retreat, len(dx))
        if problem := self.sensor.problem:
            raise ContactError(problem)
        wrench = self.sensor.at_tip(state)
        self.force = wrench[:3]
        size = float(np.linalg.norm(self.force))
        if size > self.settings.force_limit:
            self.warning = (
                f'a force of {size:.4g} N on the tip, allowed {self.settings.force_limit:g} '
                '(admittance.force_limit): retreating'
            )
            self._retreat = self.force / size
            self._left = self.settings.retreat_distance
            return self._retreating(self._retreat, len(dx))
        self.warning = ''
        rate = self.admittance.rate(wrench, state)
        self._bound_search(rate, state)
        return dx + rate

    def record(self, command: Command, dx: np.ndarray) -> None:
        """Record what was executed.

        Args:
            command: Command of the controller at this tick.
            dx: Desired task velocity dx_d, (m,).
        """
        if not self.is_on:
            return
        self.admittance.record(command, dx)
        moved = self._T * (command.J @ command.dq)[:3]
        if self._retreat is not None:
            self._left -= float(moved @ self._retreat)
        self._searched += float(moved @ self._toward)

    def asks(self, state: RobotState, missed: int = 0) -> bool:
        """Whether an arm that is at rest is to move: a wrench or a desired force asks for it.

        Args:
            state: State of the arm, as measured.
            missed: See velocity(), in place of which this is called.
        """
        self.sensor.advance(missed + 1)
        if not self.settings.enabled:
            self.admittance.restart()
            return False
        if self.sensor.problem:
            return False
        self.admittance.rest()
        rate = self.admittance.rate(self.sensor.at_tip(state), state)
        return bool((np.abs(rate) > AT_REST).any())

    def _retreating(self, direction: np.ndarray, rows: int) -> np.ndarray:
        """The velocity (rows,) of a retreat along (3,). Raises ContactError once it is over."""
        settings = self.settings
        usual = settings.retreat_distance / (settings.retreat_speed * self._T)  # ticks
        self._ticks += 1
        if self._left <= 0.0 or self._ticks > _RETREAT_TIME * usual:
            raise ContactError(self.warning.replace('retreating', 'the tip has retreated'))
        velocity = np.zeros(rows)
        velocity[:3] = settings.retreat_speed * direction
        return velocity

    def _bound_search(self, rate: np.ndarray, state: RobotState) -> None:
        """Bound the speed in rate (m,), and the distance, while force is asked for and nothing
        touches. Raises ContactError if no contact was found.
        """
        settings = self.settings
        desired = desired_force(settings, state)
        size = float(np.linalg.norm(desired))
        if size == 0.0 or float(self.force @ desired) > _TOUCHES * size**2:
            self._searched = 0.0
            self._toward = np.zeros(3)
            return
        if self._searched > settings.search_distance:
            raise ContactError(
                f'no contact within {settings.search_distance:g} m while {size:g} N are asked for '
                '(admittance.search_distance)'
            )
        self._toward = -desired / size  # the tip pushes against the environment
        excess = float(rate[:3] @ self._toward) - settings.search_speed
        if excess > 0.0:
            rate[:3] -= excess * self._toward
