"""Maps keys to task velocities: axis and sign of each key, and how long a key counts as held."""

import math
from typing import NamedTuple

import numpy as np

from redres_ros.errors import RangeError


class Way(NamedTuple):
    """A row of the task velocity, 0 to 5, and the sign along it."""

    row: int
    sign: float


# The left hand moves, the right hand turns.
WAYS = {
    'w': Way(0, 1.0),
    's': Way(0, -1.0),
    'a': Way(1, 1.0),
    'd': Way(1, -1.0),
    'r': Way(2, 1.0),
    'f': Way(2, -1.0),
    'l': Way(3, 1.0),
    'j': Way(3, -1.0),
    'i': Way(4, 1.0),
    'k': Way(4, -1.0),
    'u': Way(5, 1.0),
    'o': Way(5, -1.0),
}
FASTER = '+'
SLOWER = '-'
HELP = """\
w s  forward, back (x)      l j  turn about x
a d  left, right (y)        i k  turn about y
r f  up, down (z)           u o  turn about z
+ -  faster, slower         space  stop        Ctrl-C  end"""

_HELD = 0.6  # [s] a terminal reports no release of a key; it repeats one within half a second
_GAIN = 1.25  # of the speed, for each press of a key
_SPEEDS = (0.001, 2.0)  # [m/s]
_TURNS = (0.001, 6.0)  # [rad/s]


class KeyMap:
    """The task velocity of the held keys.

    Args:
        speed: Of a key that moves [m/s].
        turn: Of a key that turns [rad/s].

    Raises:
        RangeError: A speed that is none, or that no arm should have from a keyboard.
    """

    def __init__(self, speed: float = 0.05, turn: float = 0.3) -> None:
        _check('speed', speed, _SPEEDS, 'm/s')
        _check('turn', turn, _TURNS, 'rad/s')
        self.speed = speed
        self.turn = turn
        self._signs = np.zeros(6)
        self._until = np.full(6, -math.inf)  # [s] when a row's key counts as released

    def press(self, key: str, now: float) -> None:
        """Process a key; any key without a meaning stops the arm.

        Args:
            key: A single character.
            now: When it came [s].
        """
        way = WAYS.get(key.lower())
        if way:
            self._signs[way.row] = way.sign
            self._until[way.row] = now + _HELD
        elif key in (FASTER, SLOWER):
            gain = _GAIN if key == FASTER else 1.0 / _GAIN
            self.speed = min(max(self.speed * gain, _SPEEDS[0]), _SPEEDS[1])
            self.turn = min(max(self.turn * gain, _TURNS[0]), _TURNS[1])
        else:
            self._until[:] = -math.inf

    def twist(self, now: float) -> np.ndarray:
        """Task velocity (6,) [m/s], [rad/s]."""
        held = now < self._until
        speeds = np.repeat((self.speed, self.turn), 3)
        return np.where(held, self._signs * speeds, 0.0)


def _check(name: str, value: float, allowed: tuple[float, float], unit: str) -> None:
    if not allowed[0] <= value <= allowed[1]:
        raise RangeError(name, value, *allowed, unit)
