"""The fake robot controller: session, validator, and a reference that never jumps."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from redres_ros.errors import JointNamesError
from redres_ros.fake_robot.command_validator import CommandValidator
from redres_ros.fake_robot.plant import FaultyPlant, IdealPlant, MujocoPlant
from redres_ros.fake_robot.session import Session, SessionSettings
from redres_ros.robots.joint_limits import JointLimits
from redres_ros.types import JointPositions, Seconds

# fraction of the acceleration limit that closes a lag; the rest is left to the command itself
_CATCH_UP = 0.5


class ClientCommand(NamedTuple):
    """A client's valid command for the state of one tick."""

    tick: int
    q: JointPositions
    latency: Seconds = 0.0  # from the state to the arrival of the command; 0: not measured


@dataclass(frozen=True)
class _Course:
    """Extrapolation of commands alone: fed back, it would be unstable for a client always late."""

    tick: int  # of the last command
    q: JointPositions  # that command
    slope: JointPositions | float = 0.0  # the last step from tick to tick
    curve: JointPositions | float = 0.0  # its change from tick to tick

    def at(self, tick: int) -> JointPositions:
        """The command for the state of a tick."""
        ahead = tick - self.tick
        return self.q + ahead * self.slope + 0.5 * ahead * (ahead + 1) * self.curve

    def through(self, command: ClientCommand, curved: bool) -> '_Course':
        """The course after a command for a later tick; not curved: straight on."""
        ticks = command.tick - self.tick
        mean = (command.q - self.q) / ticks  # (n,) step since the last command
        if not curved:
            return _Course(command.tick, command.q, mean)
        # Steps slope + curve, slope + 2 curve, ... have this mean after so many ticks.
        curve = 2.0 * (mean - self.slope) / (ticks + 1)  # (n,)
        return _Course(command.tick, command.q, self.slope + ticks * curve, curve)


class FakeRobot:
    """A robot that sends its state at tick k and moves by the command for that of tick k - 1. For
    limits of other joints than the plant's it raises JointNamesError.
    """

    def __init__(
        self,
        plant: FaultyPlant | IdealPlant | MujocoPlant,
        limits: JointLimits,
        settings: SessionSettings | None = None,
    ) -> None:
        if plant.joint_names != limits.joint_names:
            raise JointNamesError(plant.joint_names, limits.joint_names)
        self.session = Session(plant.period, settings or SessionSettings())
        self.plant = plant
        self.tick = 0  # k
        self._validator = CommandValidator(limits, plant.period, self.session.profile)
        self._interpolator = _ReferenceInterpolator(limits, plant.period, plant.q)
        self._course = _Course(-1, plant.q)

    @property
    def reference(self) -> JointPositions:
        """Where the plant was sent in the last cycle; a new array in each."""
        return self._interpolator.reference

    def advance(self, *commands: ClientCommand) -> None:
        """Move from tick k to k + 1, by the commands that came since, in the order of their ticks.

        A command for state k - 1 is in time: an ideal plant is at its position at tick k + 1. An
        older one is late: the command is taken to have gone on since then at its last velocity, as
        without any command. Outside command mode the arm decelerates to rest and brakes hold it.
        """
        if self.tick > 0:  # before, no state has been sent that a command could be for
            self._receive(commands)
        if self.session.commanding:
            command = self._course.at(self.tick - 1)
            velocity = (command - self._interpolator.command) / self.plant.period  # (n,)
            if reason := self._validator.violation(command, velocity):
                self.session.stop(reason)
            else:
                self._interpolator.follow(command)
        braked = not self.session.commanding and self._interpolator.brake(self.plant.q)
        self.plant.step(self.reference, braked)
        self.tick += 1

    def _receive(self, commands: tuple[ClientCommand, ...]) -> None:
        """Count the cycle, extrapolate the commands, and begin command mode if the session does."""
        for command in commands:
            curved = self.session.profile.extrapolates_acceleration
            self._course = self._course.through(command, curved)
        if commands:
            self.session.record(self.tick - 1 - commands[-1].tick, commands[-1].latency)
        else:
            self.session.record(None)
        if not self.session.ready or self._interpolator.step.any():
            return
        first = self._course.q
        self.session.offer(float(np.abs(first - self.reference).max()))
        if self.session.commanding:
            self._course = _Course(self._course.tick, first)
            self._interpolator.begin(first)
            self._validator.begin()


class _ReferenceInterpolator:
    """Advances the reference of one arm from where it stands still.

    The reference is the command, bit for bit, as long as that keeps the velocity limits. A faster
    one is followed as fast as they allow; the lag is then closed without overshoot. Position limits
    are kept too.
    """

    def __init__(self, limits: JointLimits, period: Seconds, q: JointPositions) -> None:
        self._limits = limits
        self._max_step = limits.velocity * period  # (n,) [rad] in one cycle
        # (n,) [rad] change of the step from cycle to cycle; if accelerations are not limited, by
        # velocities alone
        self._max_change = np.minimum(limits.acceleration * period**2, 2.0 * self._max_step)
        self.reference = np.array(q, dtype=np.float64)  # (n,), replaced in each cycle
        self.step = np.zeros_like(self.reference)  # (n,) last move of the reference
        self.begin(self.reference)

    def begin(self, command: JointPositions) -> None:
        """Follow constant commands; the distance to them is a lag."""
        self.command = command  # (n,), the last one
        self._closing = np.zeros_like(command)  # (n,) part of the lag that the last cycle closed

    def follow(self, command: JointPositions) -> None:
        lag = self.command - self.reference  # (n,)
        change = _CATCH_UP * self._max_change  # (n,)
        # A lag d is closed at sqrt(a d): a braking curve at half of the acceleration a that the
        # ramp allows is not overshot.
        speed = np.minimum(np.abs(lag), np.sqrt(change * np.abs(lag)))
        desired = np.copysign(speed, lag)
        closing = self._closing + np.clip(desired - self._closing, -change, change)
        self._move(command - (lag - closing))
        self._closing = self.step - (command - self.command)
        self.command = command

    def brake(self, q: JointPositions) -> bool:
        """Decelerate as fast as the limits allow. Whether at rest: then the reference is q."""
        change = np.clip(self.step, -self._max_change, self._max_change)
        self._move(self.reference + (self.step - change))
        if self.step.any():
            return False
        self.reference = q  # what the arm presses on may have kept it from the reference
        return True

    def _move(self, target: JointPositions) -> None:
        """Go as near to the target as the limits allow; from beyond a position limit only back."""
        last = self.reference
        limits = self._limits
        upper = np.minimum(np.maximum(limits.upper, last), last + self._max_step)
        lower = np.maximum(np.minimum(limits.lower, last), last - self._max_step)
        self.reference = np.maximum(lower, np.minimum(target, upper))
        self.step = self.reference - last
