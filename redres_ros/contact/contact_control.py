"""Admittance with its force sensor, and reactions to faults of contact.

| event | reaction |
|---|---|
| a wrench that is stale or not finite | hold |
| a force above `force_limit` | retreat along the force, then hold |
| no contact while force is asked for | search, bounded in speed and distance, then hold |
"""

from collections import deque

import numpy as np

from redres_ros.command import Command
from redres_ros.contact.admittance import AT_REST, Admittance, AdmittanceSettings
from redres_ros.errors import RedresError
from redres_ros.robot_model import RobotState
from redres_ros.types import Cycles, Seconds, TaskVelocity, Wrench

# A robot's own workspace and speed limits allow these, and a surface takes a dent of them.
_SEARCH_SPEED = 0.02  # [m/s], largest at which a contact is approached
_SEARCH_DISTANCE = 0.05  # [m] after which an approach without contact ends
_RETREAT_SPEED = 0.02  # [m/s]
_RETREAT_DISTANCE = 0.01  # [m]
_RETREAT_TIME = 3.0  # times what it takes at full speed, after which a retreat ends anyway
_TOUCHES = 0.25  # of the desired force, which counts as contact
_TARED = 100  # wrenches whose mean a tare takes
_FEWEST = 10
_IMPOSSIBLE = 1e9  # [N], [Nm]; squares of much more would overflow


class ContactError(RedresError):
    """A contact that has gone wrong: the arm is to hold."""


class TareError(RedresError):
    """A tare that cannot be made."""


class _ForceSensor:
    """Turns measured wrenches into force and moment of the environment on the tip."""

    def __init__(self, timeout: Seconds, T: Seconds) -> None:
        self.timeout = timeout
        self._T = T
        self._bias = np.zeros(6)  # in the axes of the sensor
        self._recent: deque[Wrench] = deque(maxlen=_TARED)
        self._frame = ''  # the link in whose axes and about whose origin they are; '' is the tip
        self._age = np.inf  # [s]

    def enter(self, wrench: Wrench, frame: str = '') -> None:
        """Record a wrench that the environment exerts, about the origin and along the axes of a
        link; '' is the tip.
        """
        if frame != self._frame:
            self._recent.clear()
            self._frame = frame
        self._recent.append(np.array(wrench, dtype=np.float64))
        self._age = 0.0

    def advance(self, cycles: Cycles) -> None:
        """Advance the age of the wrench."""
        self._age += cycles * self._T

    @property
    def problem(self) -> str:
        """Why the wrench cannot be used; '' if it can."""
        if not self._age <= self.timeout:
            return f'no wrench for {self.timeout:g} s (admittance.wrench_timeout)'
        raw = self._recent[-1]
        if not float(np.abs(raw).max()) < _IMPOSSIBLE:
            return f'the wrench is {raw.tolist()}; expected finite values below {_IMPOSSIBLE:g}'
        return ''

    def at_tip(self, state: RobotState) -> Wrench:
        """Force and moment about the tip in the axes of the base, if a usable wrench has come."""
        x, R = state.pose(self._frame)
        measured = self._recent[-1] - self._bias
        force = R @ measured[:3]
        moment = R @ measured[3:] + np.cross(x - state.x, force)
        return np.concatenate((force, moment))

    def tare(self) -> None:
        """Take what is measured now for the sensor's bias: the arm is at rest and touches nothing.

        Raises TareError for a wrench that cannot be used.
        """
        if self.problem:
            raise TareError(self.problem)
        if len(self._recent) < _FEWEST:
            raise TareError(f'{len(self._recent)} wrenches have come; expected {_FEWEST} or more')
        mean = np.mean(self._recent, axis=0)
        if not np.isfinite(mean).all():
            raise TareError('some of the last wrenches are not finite')
        self._bias = mean


class ContactControl:
    """Admittance, sensor and reactions for one arm.

    In a closed loop:

        contact.sensor.enter(wrench)
        velocity = contact.velocity(dx, state)
        command = controller.update(q, velocity)
        contact.record(command, dx)

    Changes of the settings are faded over the switch time.
    """

    def __init__(
        self, settings: AdmittanceSettings, T: Seconds, *, switch_time: Seconds = 0.0
    ) -> None:
        self.sensor = _ForceSensor(settings.wrench_timeout, T)
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
        yields = bool((np.abs(self.admittance.de) > AT_REST).any())
        return self.is_on and (self.retreats or yields)

    @property
    def retreats(self) -> bool:
        """Whether the tip retreats."""
        return self._retreat is not None

    def set_settings(self, settings: AdmittanceSettings) -> None:
        """Go over to other settings, without a jump. Raises ArrayError for some that do not suit
        the task; the old ones then stay.
        """
        settings.check(len(self.settings.damping))
        self.admittance.settings = settings
        self.sensor.timeout = settings.wrench_timeout

    def restart(self) -> None:
        """Restart from rest, where the arm is."""
        self.admittance.restart()
        self.warning = ''  # the reason of a retreat, and of the stop that follows
        self._searched = 0.0  # [m]
        self._retreat: np.ndarray | None = None  # direction, (3,)
        self._left = 0.0  # [m] of the retreat
        self._ticks = 0  # of the retreat
        self._toward = np.zeros(3)  # direction of a search under way, (3,)

    def velocity(self, dx: TaskVelocity, state: RobotState, missed: Cycles = 0) -> TaskVelocity:
        """The task velocity dx_d + de, or that of a retreat; then call record().

        The state is as measured; `missed` cycles went without a call since the last one. Raises
        ContactError if the arm is to hold.
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
            self._left = _RETREAT_DISTANCE
            return self._retreating(self._retreat, len(dx))
        self.warning = ''
        rate = self.admittance.rate(wrench, state)
        self._bound_search(rate, state)
        return dx + rate

    def record(self, command: Command, dx: TaskVelocity) -> None:
        """Record what was executed of the desired velocity dx_d and of what was added to it."""
        if not self.is_on:
            return
        self.admittance.record(command, dx)
        moved = self._T * (command.J @ command.dq)[:3]
        if self._retreat is not None:
            self._left -= float(moved @ self._retreat)
        self._searched += float(moved @ self._toward)

    def asks(self, state: RobotState, missed: Cycles = 0) -> bool:
        """Whether an arm that is at rest is to move: a wrench or a desired force asks for it.

        It is called in place of velocity().
        """
        self.sensor.advance(missed + 1)
        if not self.settings.enabled:
            self.admittance.restart()
            return False
        if self.sensor.problem:
            return False
        self.admittance.de = np.zeros(len(self.admittance.de))
        rate = self.admittance.rate(self.sensor.at_tip(state), state)
        return bool((np.abs(rate) > AT_REST).any())

    def _retreating(self, direction: np.ndarray, rows: int) -> TaskVelocity:
        """The velocity of a retreat along (3,). Raises ContactError once it is over."""
        usual = _RETREAT_DISTANCE / (_RETREAT_SPEED * self._T)  # ticks
        self._ticks += 1
        if self._left <= 0.0 or self._ticks > _RETREAT_TIME * usual:
            raise ContactError(self.warning.replace('retreating', 'the tip has retreated'))
        velocity = np.zeros(rows)
        velocity[:3] = _RETREAT_SPEED * direction
        return velocity

    def _bound_search(self, rate: TaskVelocity, state: RobotState) -> None:
        """Bound the speed in rate, and the distance, while force is asked for and nothing touches.
        Raises ContactError if no contact was found.
        """
        desired = self.settings.desired_force(state)
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
