"""Faults of the wires between nodes in virtual time, of the kinds that PX4 injects into sensors."""

from collections.abc import Callable
from copy import deepcopy
from typing import Any, NamedTuple

import numpy as np
from virtual_graph import Fault


def off() -> Fault:
    return lambda message, now: []


def stuck() -> Fault:
    """The first message arrives again and again, in the place of all others."""
    first: list[Any] = []

    def fault(message: Any, now: float) -> list[tuple[float, Any]]:
        first.append(message)
        return [(0.0, first[0])]

    return fault


def changed(*changes: Callable[[Any], None]) -> Fault:
    """Every message is spoiled, by one change after the other in turn."""
    turn = 0

    def fault(message: Any, now: float) -> list[tuple[float, Any]]:
        nonlocal turn
        spoiled = deepcopy(message)
        changes[turn % len(changes)](spoiled)
        turn += 1
        return [(0.0, spoiled)]

    return fault


def slow() -> Fault:
    """One message of ten arrives."""
    count = 0

    def fault(message: Any, now: float) -> list[tuple[float, Any]]:
        nonlocal count
        count += 1
        return [(0.0, message)] if count % 10 == 0 else []

    return fault


def late(*, most: float, share: float, seed: int = 0) -> Fault:
    """A share of the messages, 0 to 1, comes late by up to some time [s]."""
    chance = np.random.default_rng(seed)

    def fault(message: Any, now: float) -> list[tuple[float, Any]]:
        delay = chance.uniform(0.0, most) if chance.random() < share else 0.0
        return [(delay, message)]

    return fault


def delayed() -> Fault:
    """Every message arrives 0.3 s late."""
    return lambda message, now: [(0.3, message)]


def intermittent() -> Fault:
    """Nothing arrives for 0.1 s, everything for 0.1 s, and so on."""
    began: list[float] = []

    def fault(message: Any, now: float) -> list[tuple[float, Any]]:
        began.append(now)
        return [(0.0, message)] if int((now - began[0]) / 0.1) % 2 else []

    return fault


def reordered() -> Fault:
    """Of two messages the second arrives first."""
    kept: list[Any] = []

    def fault(message: Any, now: float) -> list[tuple[float, Any]]:
        if not kept:
            kept.append(message)
            return []
        return [(0.0, message), (0.0, kept.pop())]

    return fault


BAD_JOINTS: tuple[Callable[[Any], None], ...] = (
    lambda message: message.position.__setitem__(2, np.nan),
    lambda message: setattr(message, 'position', message.position[:-1]),
    lambda message: setattr(message, 'name', [*message.name[:-1], 'x']),
    lambda message: setattr(message.header.stamp, 'sec', -1),
)
BAD_TWISTS: tuple[Callable[[Any], None], ...] = (
    lambda message: setattr(message.twist.linear, 'x', np.nan),
    lambda message: setattr(message.twist.linear, 'x', 1e300),
    lambda message: setattr(message.header, 'frame_id', 'nose'),
    lambda message: setattr(message.header.stamp, 'sec', 2**31 - 1),
)
BAD_POSES: tuple[Callable[[Any], None], ...] = (
    lambda message: setattr(message.pose.position, 'x', np.inf),
    lambda message: setattr(message.header, 'frame_id', 'nose'),
)
BAD_WORDS: tuple[Callable[[Any], None], ...] = (lambda message: setattr(message, 'data', '§$%'),)
OPPOSITE = {'CMD': 'MON', 'MON': 'CMD'}


class Channel(NamedTuple):
    """A message on its way to one node; how it is garbage, and wrong in a way that can be read."""

    topic: str
    listener: str
    garbage: tuple[Callable[[Any], None], ...]
    wrong: Callable[[Any], None]


def off_by_far(message: Any) -> None:
    message.position = [q + 0.2 for q in message.position]


def in_millimetres(message: Any) -> None:
    """Millimetres for metres, of a twist or a pose."""
    vector = message.twist.linear if hasattr(message, 'twist') else message.pose.position
    vector.x *= 1000.0
    vector.y *= 1000.0
    vector.z *= 1000.0


def with_word(word: Any) -> Callable[[Any], None]:
    """A word or a number in the place of the right one."""
    return lambda message: setattr(message, 'data', word)


def opposite(message: Any) -> None:
    """Command mode for monitoring, and the other way round."""
    message.data = OPPOSITE[message.data]


CHANNELS = (
    Channel('joint_states', 'controller', BAD_JOINTS, off_by_far),
    Channel('joint_states', 'planner', BAD_JOINTS, off_by_far),
    Channel('joint_command', 'sim', BAD_JOINTS, off_by_far),
    Channel('cartesian_velocity', 'controller', BAD_TWISTS, in_millimetres),
    Channel('target_pose', 'planner', BAD_POSES, in_millimetres),
    Channel('controller/task_scaling', 'planner', (with_word(np.nan),), with_word(7.0)),
    Channel('sim/session_state', 'controller', BAD_WORDS, opposite),
    Channel('sim/stop_reason', 'planner', BAD_WORDS, with_word('')),
)

# The controller listens to it while the arm yields.
WRENCH = Channel(
    'wrench',
    'controller',
    (
        lambda message: setattr(message.wrench.force, 'x', np.nan),
        lambda message: setattr(message.wrench.torque, 'z', np.inf),
        lambda message: setattr(message.header, 'frame_id', 'nose'),
        lambda message: setattr(message.header.stamp, 'sec', 2**31 - 1),
    ),
    lambda message: setattr(message.wrench.force, 'z', 200.0),
)

FAULTS = ('off', 'stuck', 'garbage', 'wrong', 'slow', 'delayed', 'intermittent', 'reordered')


def make_fault(channel: Channel, name: str) -> Fault:
    if name == 'garbage':
        return changed(*channel.garbage)
    if name == 'wrong':
        return changed(channel.wrong)
    made: Fault = globals()[name]()
    return made
