"""The way of messages from one end to the other, with the faults of a network. It knows no clock
but ticks.
"""

from collections import deque
from dataclasses import dataclass
from random import Random
from typing import Generic, TypeVar

M = TypeVar('M')


@dataclass(frozen=True)
class Link:
    """What happens to messages on their way; nothing by default.

    Attributes:
        delay: of every message [cycles].
        delay_spread: up to so many more, evenly distributed [cycles]. No message overtakes another.
        loss: share of messages that are lost on an average.
        loss_burst: how many are lost in a row each time.
        duplication: share of messages that arrive twice.
        reordering: chance of a message to arrive with the next one, but after it.
    """

    delay: int = 0
    delay_spread: int = 0
    loss: float = 0.0
    loss_burst: int = 1
    duplication: float = 0.0
    reordering: float = 0.0


class Channel(Generic[M]):
    """Takes messages in and gives them out as `link` says, which may be set at any time.

    What happens is random, but the same seed, messages and links make the same happen. Every
    message takes four random numbers whatever the link, so that setting one fault does not change
    when another one strikes.

    Args:
        seed: of what happens.
        link: what happens.
    """

    def __init__(self, seed: int | str = 0, link: Link | None = None) -> None:
        self.link = link or Link()
        self._random = Random(seed)
        # with the tick when each is due, in the order of arrival
        self._under_way: deque[tuple[int, M]] = deque()
        self._overtaken: list[M] = []  # to arrive right after the next message
        self._still_to_lose = 0

    def send(self, message: M, tick: int) -> None:
        """Put a message in.

        Args:
            message: given out as it is.
            tick: the present one.
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
        """What arrives up to a tick and was not received yet; what is behind a message that is late
        waits for it.
        """
        arrived = []
        while self._under_way and self._under_way[0][0] <= tick:
            arrived.append(self._under_way.popleft()[1])
        return arrived

    def _is_lost(self, chance: float) -> bool:
        """Losses come in bursts, seldom enough for `loss` to be the share of messages that are lost
        on an average.
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
