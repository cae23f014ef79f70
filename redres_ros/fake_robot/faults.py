"""Faults to inject into the fake robot: in the network, in the encoders, at the arm, in its force
sensor.
"""

from collections import deque
from dataclasses import dataclass
from functools import partial
from random import Random
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from redres_ros.errors import ArrayError, RangeError, UnknownNameError
from redres_ros.parameter import check_parameters, param
from redres_ros.types import Cycles, JointPositions, JointTorques, JointVelocities, Radians, Wrench

if TYPE_CHECKING:
    from redres_ros.fake_robot.plant import IdealPlant, MujocoPlant

M = TypeVar('M')

# What the force sensor may do, and with which figures
_SENSOR_FAULTS = ('none', 'noise', 'bias', 'saturated', 'not_finite', 'lost')
_SENSOR_NOISE = np.repeat((1.0, 0.1), 3)  # [N], [Nm]
_SENSOR_BIAS = 5.0  # [N] along the tip's z
_SENSOR_RANGE = 10.0  # [N], [Nm] of a saturated one

_live = partial(param, live=True)
_fraction = partial(_live, 0.0, lower=0.0, upper=1.0)
_cycles = partial(_live, 0, lower=0, upper=1000)


@dataclass(frozen=True)
class Link:
    """Faults of a network; none by default."""

    delay: Cycles = 0  # of every message
    loss: float = 0.0  # probability that a message is lost
    duplication: float = 0.0  # probability that a message arrives twice
    reordering: float = 0.0  # probability that a message arrives right after the next one


class NetworkModel(Generic[M]):
    """Delivers messages with the faults of `link`, which may be set at any time.

    Faults are random but repeatable: the same seed, messages and links give the same result. Every
    message draws three random numbers whatever the link, so setting one fault does not move the
    others.
    """

    def __init__(self, seed: int | str = 0, link: Link | None = None) -> None:
        self.link = link or Link()
        self._random = Random(seed)
        # with the tick when each is due, in the order of arrival
        self._under_way: deque[tuple[int, M]] = deque()
        self._overtaken: list[M] = []  # to arrive right after the next message

    def send(self, message: M, tick: int) -> None:
        """Send a message at a tick; it is delivered unchanged."""
        losing, doubling, overtaking = (self._random.random() for _ in range(3))
        if losing < self.link.loss:
            return
        copies = [message]
        if doubling < self.link.duplication:
            copies.append(message)
        if not self._overtaken and overtaking < self.link.reordering:
            self._overtaken = copies
            return
        due = tick + self.link.delay
        self._under_way.extend((due, arriving) for arriving in (*copies, *self._overtaken))
        self._overtaken = []

    def receive(self, tick: int) -> list[M]:
        """Messages that have arrived by a tick and were not received yet. A late one holds up those
        behind it.
        """
        arrived = []
        while self._under_way and self._under_way[0][0] <= tick:
            arrived.append(self._under_way.popleft()[1])
        return arrived


@dataclass(frozen=True)
class Faults:
    """Every fault as a parameter that can be set while it runs. By default all is well.

    Raises RangeError, UnknownNameError or ArrayError for what cannot be.
    """

    state_delay: int = _cycles('delay of states to the client [cycles]')
    state_loss: float = _fraction('fraction of the states that are lost')
    command_delay: int = _cycles('delay of commands to the robot [cycles]')
    command_loss: float = _fraction('fraction of the commands that are lost')
    disorder: float = _fraction(
        'fraction of states and commands that arrive twice, and of those that arrive after the next'
    )
    encoder_noise: float = _live(0.0, 'standard deviation of measured positions [rad]', 0.0, 0.1)
    frozen_joint: int = _live(
        0, 'joint whose encoder is frozen, 1 next to the base; 0: none', 0, 100
    )
    push_force: tuple[float, ...] = _live(
        (0.0, 0.0, 0.0), 'force on the arm along x, y, z of the base [N]', -500.0, 500.0
    )
    push_link: str = _live('', 'link on whose origin this force acts; empty: the tip')
    wrench_fault: str = _live('none', 'what the force sensor shows', choices=_SENSOR_FAULTS)
    paused_physics: bool = _live(False, 'the arm ignores every command')
    encoder_step: Radians = 0.0  # resolution of measured positions; no parameter of the node

    def __post_init__(self) -> None:
        check_parameters(self)
        if len(self.push_force) != 3:
            raise ArrayError(f'push_force holds {len(self.push_force)} numbers; expected 3')

    @property
    def states(self) -> Link:
        """Faults of the link that carries states to the client."""
        return Link(self.state_delay, self.state_loss, self.disorder, self.disorder)

    @property
    def commands(self) -> Link:
        """Faults of the link that carries commands to the robot."""
        return Link(self.command_delay, self.command_loss, self.disorder, self.disorder)


class FaultyPlant:
    """A plant as its faulty sensors show it; without faults exactly the plant itself.

    Noise of the encoders is drawn once a cycle, the same for the same seed. The velocities of
    encoders at fault are differences of their positions. While the physics are paused the plant
    stands still and receives nothing; afterwards its servos drive it to the reference as hard as
    they can, and an ideal one jumps there.

    Raises RangeError for a frozen joint, and UnknownNameError for a pushed link, that the arm does
    not have.
    """

    def __init__(
        self, plant: 'IdealPlant | MujocoPlant', faults: Faults | None = None, seed: int = 0
    ) -> None:
        self.joint_names = plant.joint_names
        self.period = plant.period
        self._plant = plant
        self._random = np.random.default_rng(seed)
        self._wrench_random = np.random.default_rng(seed)  # drawn as often as somebody subscribes
        self._q = plant.q
        self._dq = plant.dq  # (n,), as measured
        self._pushed = False  # in the last cycle
        self.faults = faults or Faults()

    @property
    def faults(self) -> Faults:
        """The faults of this arm; set, they act from the next cycle on."""
        return self._faults

    @faults.setter
    def faults(self, faults: Faults) -> None:
        self.check(faults)
        self._faults = faults

    def check(self, faults: Faults) -> None:
        """Refuse faults of parts that the arm does not have.

        Raises:
            RangeError: No such frozen joint.
            UnknownNameError: No such pushed link.
        """
        links = self._plant.links
        if faults.push_link and links and faults.push_link not in links:
            raise UnknownNameError('link', faults.push_link, links)
        if faults.frozen_joint > len(self.joint_names):
            raise RangeError('frozen_joint', faults.frozen_joint, 0, len(self.joint_names))

    @property
    def q(self) -> JointPositions:
        """Measured joint positions."""
        return self._q.copy()

    @property
    def dq(self) -> JointVelocities:
        """Measured joint velocities."""
        return self._dq.copy()

    @property
    def wrench(self) -> Wrench | None:
        """Measured force and moment on the tip, along the tip's axes; None: it is lost."""
        shown = self._plant.wrench
        match self._faults.wrench_fault:
            case 'noise':
                shown += self._wrench_random.normal(size=6) * _SENSOR_NOISE
            case 'bias':
                shown[2] += _SENSOR_BIAS
            case 'saturated':
                shown = np.clip(shown, -_SENSOR_RANGE, _SENSOR_RANGE)
            case 'not_finite':
                shown[:] = np.nan
            case 'lost':
                return None
        return shown

    @property
    def effort(self) -> JointTorques | None:
        """Torques of the motors; None for an arm that does not measure them."""
        return self._plant.effort

    @property
    def external_torques(self) -> JointTorques:
        """Joint torques of the forces from outside."""
        return self._plant.external_torques

    def step(self, q_ref: JointPositions) -> None:
        """Move for one cycle, during which the reference goes on to q_ref; or stand still."""
        faults = self._faults  # one for the whole cycle
        if faults.paused_physics:
            self._measure(faults, self._plant.q, np.zeros_like(self._q))
            return
        pushed = any(faults.push_force)
        if pushed or self._pushed:
            self._plant.push(np.array(faults.push_force), faults.push_link)
        self._pushed = pushed
        self._plant.step(q_ref)
        self._measure(faults, self._plant.q, self._plant.dq)

    def _measure(self, faults: Faults, q: JointPositions, dq: JointVelocities) -> None:
        """Take what the encoders show of q, dq."""
        measured = q.copy()
        if faults.encoder_noise:
            measured += self._random.normal(0.0, faults.encoder_noise, len(q))
        if faults.encoder_step:
            measured = faults.encoder_step * np.round(measured / faults.encoder_step)
        if faults.frozen_joint:
            measured[faults.frozen_joint - 1] = self._q[faults.frozen_joint - 1]
        faulty = faults.encoder_noise or faults.encoder_step or faults.frozen_joint
        self._dq = (measured - self._q) / self.period if faulty else dq
        self._q = measured
