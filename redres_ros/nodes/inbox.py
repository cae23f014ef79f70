"""Commands on their way into the fake robot: which state each answers, or why it is refused."""

import math
import time
from collections import deque
from typing import NamedTuple

import numpy as np
from sensor_msgs.msg import JointState

from redres_ros.errors import ArrayError, JointNamesError, RedresError
from redres_ros.fri.channel import Channel, Link
from redres_ros.fri.refusal import Refusal, Refused
from redres_ros.fri.robot import Answer
from redres_ros.fri.robot_clock import NANOSECONDS, RobotClock, StampError
from redres_ros.fri.session import Session
from redres_ros.nodes.conversions import JointOrder, LengthError, to_nanoseconds
from redres_ros.nodes.diagnostics import Refusals


class PublisherError(RedresError):
    """A command while more than one publishes commands."""


_CONTEST = 1.0  # [s] for which publishers count as rivals after a state was answered twice

_KINDS = {  # the first class that an error is of tells what kind of refusal it is
    StampError: Refusal.NO_STATE,
    PublisherError: Refusal.SECOND_PUBLISHER,
    JointNamesError: Refusal.WRONG_NAMES,
    LengthError: Refusal.WRONG_LENGTH,
    ArrayError: Refusal.NOT_FINITE,
}


class _Arrival(NamedTuple):
    """A command: stamp [ns] of the state that it answers, and its positions (n,) [rad], or what is
    wrong with them.

    time: when it came by the monotonic clock [s]; tick: at which the robot's network took it.
    """

    stamp: int
    q: np.ndarray | RedresError
    time: float
    tick: int = 0


class Inbox:
    """Turns commands into answers. `put` is called by whoever receives them, the rest by the
    robot's loop.

    publishers: how many there are in the graph; while more than one answers, nobody's commands are
    taken. One that was killed stays in the graph for some 20 s, but is silent. link: what the
    transport does to commands, can be set at any time. timed: whether latencies are measured; in
    lock-step they mean nothing. Refusals are told to the log and counted by the session.
    """

    def __init__(
        self,
        joints: JointOrder,
        clock: RobotClock,
        session: Session,
        refusals: Refusals,
        link: Link,
        seed: int,
        timed: bool,
    ) -> None:
        self._joints = joints
        self._clock = clock
        self._session = session
        self._refusals = refusals
        self._under_way: Channel[_Arrival] = Channel(f'{seed} commands', link)
        self._arrivals: deque[_Arrival] = deque()
        self.newest = 0  # stamp [ns] of the state that the newest command answers
        self._contested = -math.inf  # when a state was last answered again [s]
        self._timed = timed
        self.publishers = 0

    def set_link(self, link: Link) -> None:
        """Change what the transport does."""
        self._under_way.link = link

    def put(self, message: JointState) -> None:
        """A command has come; the message is not kept."""
        now = time.monotonic()
        stamp = to_nanoseconds(message.header.stamp)
        if stamp <= self.newest:
            self._contested = now
        self.newest = stamp
        try:
            q = self._joints.positions(message)
        except RedresError as error:
            q = error
        self._arrivals.append(_Arrival(stamp, q, now))

    def take(self, tick: int) -> list[Answer]:
        """What the robot gets at a tick: the commands that came since the last one, as answers to
        ticks before it.
        """
        while self._arrivals:
            self._under_way.send(self._arrivals.popleft()._replace(tick=tick), tick)
        answers = (self._to_answer(arrival, tick) for arrival in self._under_way.receive(tick))
        return [answer for answer in answers if answer is not None]

    def _to_answer(self, arrival: _Arrival, now: int) -> Answer | None:
        try:
            tick = self._tick(arrival.stamp, now)
            if isinstance(arrival.q, RedresError):
                raise arrival.q
        except RedresError as error:
            self._refusals.refuse('joint_command', error)
            kind = next(kind for cls, kind in _KINDS.items() if isinstance(error, cls))
            self._session.refuse(Refused(kind, str(error)))
            return None
        self._refusals.accept('joint_command')
        if not self._timed:
            return Answer(tick, arrival.q)
        # [s] by faults, after it had come
        delayed = (now - arrival.tick) * self._clock.period / NANOSECONDS
        return Answer(tick, arrival.q, self._clock.latency(tick, arrival.time + delayed))

    def _tick(self, stamp: int, now: int) -> int:
        if self.publishers > 1 and time.monotonic() - self._contested < _CONTEST:
            raise PublisherError(
                f'joint_command has {self.publishers} publishers that answer; allowed: 1'
            )
        tick = self._clock.tick(stamp)
        if tick >= now:
            raise StampError(f'stamp {stamp} ns is that of no state sent so far')
        return tick
