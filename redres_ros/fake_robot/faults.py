"""Faults to inject into the fake robot: their parameters, and a network that has them."""

from collections import deque
from dataclasses import dataclass
from functools import partial
from random import Random
from typing import Generic, TypeVar

from redres_ros.errors import ArrayError
from redres_ros.parameter import Checked, param
from redres_ros.types import Cycles, Radians

M = TypeVar('M')

_live = partial(param, live=True)
_fraction = partial(_live, 0.0, lower=0.0, upper=1.0)
_cycles = partial(_live, 0, lower=0, upper=1000)


class NetworkModel(Generic[M]):
    """Delivers messages with the faults that are set, the same for the same seed.

    Every message draws three random numbers whatever is set: one fault does not move the others.
    """

    def __init__(self, seed: int | str) -> None:
        self.set_faults()
        self._random = Random(seed)
        self._under_way: deque[tuple[int, M]] = deque()  # with the tick when each is due
        self._overtaken: list[M] = []  # to arrive right after the next message

    def set_faults(self, delay: Cycles = 0, loss: float = 0.0, disorder: float = 0.0) -> None:
        """Set the delay, the probability of loss, and that of arriving twice or after the next."""
        self._delay = delay
        self._loss = loss
        self._disorder = disorder

    def send(self, message: M, tick: int) -> None:
        losing, doubling, overtaking = (self._random.random() for _ in range(3))
        if losing < self._loss:
            return
        copies = [message, message] if doubling < self._disorder else [message]
        if not self._overtaken and overtaking < self._disorder:
            self._overtaken = copies
            return
        due = tick + self._delay
        self._under_way.extend((due, arriving) for arriving in (*copies, *self._overtaken))
        self._overtaken = []

    def receive(self, tick: int) -> list[M]:
        """New messages that have arrived by a tick. A late one holds up those behind it."""
        arrived = []
        while self._under_way and self._under_way[0][0] <= tick:
            arrived.append(self._under_way.popleft()[1])
        return arrived


@dataclass(frozen=True)
class Faults(Checked):
    """Faults as parameters that can be set at any time; none by default. Raises ArrayError."""

    state_delay: int = _cycles('delay of states to the client [cycles]')
    state_loss: float = _fraction('fraction of the states that are lost')
    command_delay: int = _cycles('delay of commands to the robot [cycles]')
    command_loss: float = _fraction('fraction of the commands that are lost')
    disorder: float = _fraction(
        'fraction of states and commands that arrive twice, and of those that arrive after the next'
    )
    encoder_noise: float = _live(0.0, 'standard deviation of measured positions [rad]', 0.0, 0.1)
    push_force: tuple[float, ...] = _live(
        (0.0, 0.0, 0.0), 'force on the arm along x, y, z of the base [N]', -500.0, 500.0
    )
    push_link: str = _live('', 'link on whose origin this force acts; empty: the tip')
    wrench_fault: str = _live(
        'none', 'what the force sensor shows', choices=('none', 'bias', 'not_finite', 'lost')
    )
    encoder_step: Radians = 0.0  # resolution of measured positions; no parameter of the node

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.push_force) != 3:
            raise ArrayError(f'push_force holds {len(self.push_force)} numbers; expected 3')
