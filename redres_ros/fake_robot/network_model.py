"""A model of a network with delay, loss, duplication and reordering. Time counts in ticks."""

from collections import deque
from dataclasses import dataclass
from random import Random
from typing import Generic, TypeVar

from redres_ros.types import Cycles

M = TypeVar('M')


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
