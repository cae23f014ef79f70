"""The fake robot controller as one object: session, validator, and the reference of its servos,
which follows the commands, or brakes, and never jumps.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from redres_ros.errors import JointNamesError, RedresError
from redres_ros.fake_robot.command_validator import CommandValidator
from redres_ros.fake_robot.session import Session
from redres_ros.robots.joint_limits import JointLimits

# fraction of the acceleration limit that closes a lag; the rest is left to the command itself
_CATCH_UP = 0.5


class Plant(Protocol):
    """The simulated arm.

    Attributes:
        joint_names: Names of the joints, in the order of every array.
        period: The cycle [s], which `step` takes.
        q: Positions, (n,) [rad], an array of its own each time.
        dq: Velocities, (n,) [rad/s], likewise.
    """

    joint_names: tuple[str, ...]
    period: float

    @property
    def q(self) -> np.ndarray: ...

    @property
    def dq(self) -> np.ndarray: ...

    def step(self, q_ref: np.ndarray) -> None: ...


@dataclass(frozen=True)
class ClientCommand:
    """A client's valid command for the state of one tick.

    Attributes:
        tick: That of the state.
        q: Commanded position, outside command mode where the arm stands, (n,) [rad].
        latency: Time from the state to the arrival of the command [s]; 0 if it is not measured.
    """

    tick: int
    q: np.ndarray
    latency: float = 0.0


@dataclass(frozen=True)
class _Course:
    """Extrapolation through the last commands.

    What was extrapolated before must not enter: fed back like that, a client that is always late
    would be unstable.

    Attributes:
        tick: That of the last command.
        q: Its command, (n,) [rad].
        slope: The last step from tick to tick, (n,) [rad].
        curve: Its change from tick to tick, (n,) [rad]; 0 for a course that is a straight line.
    """

    tick: int
    q: np.ndarray
    slope: np.ndarray
    curve: np.ndarray

    @classmethod
    def standstill(cls, tick: int, q: np.ndarray) -> '_Course':
        """A course at rest at q (n,) [rad] since a tick."""
        return cls(tick, q, np.zeros_like(q), np.zeros_like(q))

    def at(self, tick: int) -> np.ndarray:
        """The command for the state of a tick, (n,) [rad]."""
        ahead = tick - self.tick
        return self.q + ahead * self.slope + 0.5 * ahead * (ahead + 1) * self.curve

    def through(self, command: ClientCommand, curved: bool) -> '_Course':
        """The course after another command.

        Args:
            command: Command for a later tick.
            curved: Whether the course goes on with the last change of its step, and not straight
                on.
        """
        q = np.array(command.q, dtype=np.float64)
        ticks = command.tick - self.tick
        slope = (q - self.q) / ticks  # (n,) the mean step since the last command
        if not curved:
            return _Course(command.tick, q, slope, np.zeros_like(q))
        # Steps slope + curve, slope + 2 curve, ... have this mean after so many ticks.
        curve = 2.0 * (slope - self.slope) / (ticks + 1)  # (n,)
        return _Course(command.tick, q, self.slope + ticks * curve, curve)


class FakeRobot:
    """A robot that sends its state at tick k and moves by the command for the state of tick k - 1.

    Attributes:
        tick: Number k of the present tick.
        period: The cycle [s].
        joint_names: Names of the joints, in the order of every array.

    Args:
        plant: The arm.
        guard: What may be commanded.
        session: Who may command, and when.

    Raises:
        RedresError: If the parts do not have the same cycle.
        JointNamesError: If they do not have the same joints.
    """

    def __init__(self, plant: Plant, guard: CommandValidator, session: Session) -> None:
        if not plant.period == guard.period == session.period:
            raise RedresError(
                f'plant, guard and session have cycles of {plant.period:g}, {guard.period:g} and '
                f'{session.period:g} s; they must be the same'
            )
        if plant.joint_names != guard.limits.joint_names:
            raise JointNamesError(plant.joint_names, guard.limits.joint_names)
        self.session = session
        self._plant = plant
        self._guard = guard
        self._follower = ReferenceInterpolator(guard.limits, plant.period, plant.q)
        self.tick = 0
        self.period = plant.period
        self.joint_names = plant.joint_names
        self._course = _Course.standstill(-1, plant.q)
        self._curved = session.profile.extrapolates_acceleration
        self._command = plant.q  # (n,) [rad] last one executed

    @property
    def q(self) -> np.ndarray:
        """Joint positions measured at this tick, (n,) [rad]."""
        return self._plant.q

    @property
    def dq(self) -> np.ndarray:
        """Joint velocities at this tick, (n,) [rad/s]."""
        return self._plant.dq

    @property
    def at_rest(self) -> bool:
        """Whether the reference stands still."""
        return self._follower.at_rest

    @property
    def reference(self) -> np.ndarray:
        """Reference in force, (n,) [rad]: where the plant was sent in the last cycle."""
        return self._follower.reference

    def advance(self, *commands: ClientCommand | None) -> None:
        """Move from tick k to k + 1.

        A command for state k - 1 is in time, an ideal plant at its position at tick k + 1. An
        older one is late: the command is taken to have gone on since then at its last velocity, as
        it does when no command comes. Outside command mode the arm holds its position; from any
        motion it is braked there.

        Args:
            commands: Those that came since the last call, as a CommandReceiver gives them: each for
                a tick before this one and after that of the command before. None is none.
        """
        if self.tick > 0:  # before, no state has been sent that a command could be for
            self._receive(commands)
        if self.session.commanding:
            self._execute(self._course.at(self.tick - 1))
        if not self.session.commanding:
            self._follower.brake()
        self._plant.step(self._follower.reference)
        self.tick += 1

    def reset(self) -> None:
        """Clear the reason of a stop and start monitoring again; an arm that moves is braked."""
        self.session.reset()

    def _receive(self, commands: tuple[ClientCommand | None, ...]) -> None:
        """Count the cycle in the session; extrapolate from the commands."""
        lateness = None
        latency = 0.0
        for command in commands:
            if command is not None:
                self._course = self._course.through(command, self._curved)
                lateness = self.tick - 1 - command.tick
                latency = command.latency
        self.session.record(lateness, latency)
        if self.session.ready and self._follower.at_rest:
            self._begin()

    def _begin(self) -> None:
        """Let the session decide whether command mode begins with this command, as from a
        standstill there.
        """
        command = self._course.q
        self.session.offer(float(np.abs(command - self._follower.reference).max()))
        if self.session.commanding:
            self._course = _Course.standstill(self._course.tick, command)
            self._command = command
            self._follower.begin(command)
            self._guard.begin()

    def _execute(self, command: np.ndarray) -> None:
        """Follow the command (n,) [rad], unless the validator has a reason to stop."""
        step = command - self._command  # (n,)
        if reason := self._guard.violation(command, step / self.period):
            self.session.stop(reason)
            return
        self._follower.follow(command, step)
        self._command = command


class ReferenceInterpolator:
    """Advances the reference of one arm, cycle by cycle.

    The reference is the command, bit for bit, as long as the command keeps the velocity limits. A
    faster one is followed as fast as they allow; the lag is then closed without overshoot. Position
    limits are kept too, from wherever the arm stands.

    Args:
        limits: Limits of the joints.
        period: The cycle [s].
        q: Where the arm stands still, (n,) [rad].
    """

    def __init__(self, limits: JointLimits, period: float, q: np.ndarray) -> None:
        self._limits = limits
        self._max_step = limits.velocity * period  # (n,) [rad] in one cycle
        # (n,) [rad] change of the step from cycle to cycle; if accelerations are not limited, by
        # velocities alone
        self._max_change = np.minimum(limits.acceleration * period**2, 2.0 * self._max_step)
        self._reference = np.array(q, dtype=np.float64)  # (n,)
        self._step = np.zeros_like(self._reference)  # (n,) last move of the reference
        self.begin(self._reference)

    @property
    def reference(self) -> np.ndarray:
        """Reference in force, (n,) [rad]."""
        return self._reference.copy()

    @property
    def at_rest(self) -> bool:
        """Whether the reference stands still."""
        return not self._step.any()

    def begin(self, command: np.ndarray) -> None:
        """Follow constant commands at `command` (n,) [rad]; the distance to it is a lag."""
        self._lag = command - self._reference  # (n,)
        self._closing = np.zeros_like(self._lag)  # (n,) part of the lag that the last cycle closed

    def follow(self, command: np.ndarray, step: np.ndarray) -> None:
        """Move on to a command.

        Args:
            command: Where to, (n,) [rad].
            step: How far that is beyond the command before, (n,) [rad].
        """
        change = _CATCH_UP * self._max_change  # (n,)
        # A lag d is closed at sqrt(a d), a braking curve at half of the acceleration a that the
        # ramp allows. So it is not overshot.
        wanted = np.copysign(
            np.minimum(np.abs(self._lag), np.sqrt(change * np.abs(self._lag))), self._lag
        )
        closing = self._closing + _bounded(wanted - self._closing, change)
        self._move(command - (self._lag - closing))
        self._closing = self._step - step
        self._lag = command - self._reference

    def brake(self) -> None:
        """Decelerate to rest, each joint as fast as its acceleration limit allows."""
        self._move(self._reference + (self._step - _bounded(self._step, self._max_change)))

    def _move(self, target: np.ndarray) -> None:
        """Go to the target or as near as the limits allow; an arm beyond a position limit can only
        come back.
        """
        last = self._reference
        limits = self._limits
        upper = np.minimum(np.maximum(limits.upper, last), last + self._max_step)
        lower = np.maximum(np.minimum(limits.lower, last), last - self._max_step)
        self._reference = np.maximum(lower, np.minimum(target, upper))
        self._step = self._reference - last


def _bounded(value: np.ndarray, bound: np.ndarray) -> np.ndarray:
    """The value brought within -bound and bound; several times as fast as np.clip for so few
    joints.
    """
    return np.minimum(np.maximum(value, -bound), bound)
