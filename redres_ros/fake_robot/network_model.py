"""A model of a network with delay, loss, duplication and reordering. Time counts in ticks."""

from collections import deque
from dataclasses import dataclass
from random import Random
from typing import Generic, TypeVar

M = TypeVar('M')


@dataclass(frozen=True)
class Link:
    """Faults of a network; none by default.

    Attributes:
        delay: Delay of every message [cycles].
        delay_spread: Random delay on top, uniform [cycles]. No message overtakes another.
        loss: Mean fraction of messages that are lost.
        loss_burst: Messages lost in a row each time.
        duplication: Fraction of messages that arrive twice.
        reordering: Probability that a message arrives right after the next one.
    """

    delay: int = 0
    delay_spread: int = 0
    loss: float = 0.0
    loss_burst: int = 1
    duplication: float = 0.0
    reordering: float = 0.0


class NetworkModel(Generic[M]):
    """Delivers messages with the faults of `link`, which may be set at any time.

    Faults are random but repeatable: the same seed, messages and links give the same result. Every
    message draws four random numbers whatever the link, so setting one fault does not move the
    others.

    Args:
        seed: Random seed.
        link: Faults of the network.
    """

    def __init__(self, seed: int | str = 0, link: Link | None = None) -> None:
        self.link = link or Link()
        self._random = Random(seed)
        # with the tick when each is due, in the order of arrival
        self._under_way: deque[tuple[int, M]] = deque()
        self._overtaken: list[M] = []  # to arrive right after the next message
        self._still_to_lose = 0

    def send(self, message: M, tick: int) -> None:
        """Send a message.

        Args:
            message: Delivered unchanged.
            tick: The present tick.
        """
        losing, doubling, overtaking, spread = (self._random.random() for _ in range(4))
        if self._is_lost(losing):
            return
        copies = [message]
        if doubling < self.link.duplication:
            copies.append(message)
        if not self._overtaken and overtaking < self.link.reordering:
            self._overtaken = copies
            return
        due = tick + self.link.delay + int(spread * (self.link.delay_spread + 1))
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

    def _is_lost(self, chance: float) -> bool:
        """Whether the next message is lost. Losses come in bursts; `loss` is their
        mean fraction.
        """
        loss = self.link.loss
        burst = self.link.loss_burst
        if not loss:
            self._still_to_lose = 0
        elif self._still_to_lose == 0 and chance < loss / (loss + burst * (1.0 - loss)):
            self._still_to_lose = burst
        lost = self._still_to_lose > 0
        self._still_to_lose -= lost
        return lost
