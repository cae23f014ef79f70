"""What the limits `collision` and `workspace` keep away from, and what the tip can touch, as shapes
to draw.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

_BOX = 'box'
SPHERE = 'sphere'

_PLANE = 3.0  # [m], width of a plane that has no end
_TABLE = 1.0  # [m], width of a surface that the tip can touch
_THICKNESS = 0.001  # [m]


class DrawnShape(NamedTuple):
    """A shape in the frame of the base.

    Attributes:
        kind: BOX or SPHERE.
        centre: (3,) [m].
        size: Edges of a box, or a sphere's diameter three times, (3,) [m].
        keeps_in: Whether the arm stays inside; else outside.
        quaternion: Orientation x, y, z, w, (4,).
        is_solid: Whether the tip can touch it.
    """

    kind: str
    centre: np.ndarray
    size: np.ndarray
    keeps_in: bool = False
    quaternion: tuple[float, ...] = (0.0, 0.0, 0.0, 1.0)
    is_solid: bool = False


def shapes_of(value: Callable[[str], Any]) -> Iterator[DrawnShape]:
    """The shapes of the limits that are on, by the value of each of the controller's parameters."""
    limits = value('limits')
    if 'collision' in limits:
        yield _plate(np.array((0.0, 0.0, value('collision.floor') - _THICKNESS / 2.0)))
        yield from _spheres(value('collision.spheres'), keeps_in=False)
    if 'workspace' in limits:
        for side in ('inside', 'outside'):
            keeps_in = side == 'inside'
            yield from _spheres(value(f'workspace.{side}_spheres'), keeps_in)
            yield from _boxes(value(f'workspace.{side}_boxes'), keeps_in)
        yield from _half_spaces(value('workspace.half_spaces'))


def touched(value: Callable[[str], Any]) -> Iterator[DrawnShape]:
    """The surface that the tip can touch, where it touches it, by the value of each of the fake
    robot's parameters.
    """
    shape = value('contact_shape')
    centre = np.array(value('contact_position'))
    if shape != 'none':
        normal = (0.0, 0.0, 1.0) if shape == 'table' else (-centre[0], -centre[1], 0.0)
        plate = _turned_plate(np.array(normal), centre)
        yield plate._replace(size=np.array((_TABLE, _TABLE, _THICKNESS)), is_solid=True)


def _spheres(numbers: Sequence[float], keeps_in: bool) -> Iterator[DrawnShape]:
    for *centre, radius in np.reshape(numbers, (-1, 4)):
        if radius > 0.0:
            yield DrawnShape(SPHERE, np.array(centre), np.full(3, 2.0 * radius), keeps_in)


def _boxes(numbers: Sequence[float], keeps_in: bool) -> Iterator[DrawnShape]:
    for lower, upper in np.reshape(numbers, (-1, 2, 3)):
        if (lower < upper).any():
            yield DrawnShape(_BOX, (lower + upper) / 2.0, upper - lower, keeps_in)


def _half_spaces(numbers: Sequence[float]) -> Iterator[DrawnShape]:
    """A plate at the end of each."""
    for *normal, offset in np.reshape(numbers, (-1, 4)):
        length = float(np.linalg.norm(normal))
        if length > 0.0:
            n = np.array(normal) / length
            yield _turned_plate(n, offset / length * n)


def _turned_plate(normal: np.ndarray, centre: np.ndarray) -> DrawnShape:
    """A plate at a centre (3,) [m] that is turned from z to a normal (3,) of any length."""
    n = normal / np.linalg.norm(normal)
    half = np.array((-n[1], n[0], 0.0, 1.0 + n[2]))  # z x n, 1 + z n
    if half[3] < 1e-9:
        half = np.array((1.0, 0.0, 0.0, 0.0))
    turn = tuple((half / np.linalg.norm(half)).tolist())
    return _plate(centre)._replace(quaternion=turn)


def _plate(centre: np.ndarray) -> DrawnShape:
    return DrawnShape(_BOX, centre, np.array((_PLANE, _PLANE, _THICKNESS)))
