"""The scene that an arm moves in, as shapes in the frame of the base: what its bodies keep off (the
limit `collision`), what its tip and other points keep to (`workspace`), and how these are drawn.

Shapes are given as a text, by kind and numbers [m]: 'floor -0.1; sphere 0.5 0 0.4 0.1'.
"""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from redres_ros.errors import ArrayError
from redres_ros.types import Meters, Position, Quaternion

OBSTACLES = {'floor': 'z', 'sphere': 'x y z radius'}
WALLS = {
    'half_space': 'a b c d',  # a x + b y + c z <= d
    'inside_box': 'x y z x y z',  # least, then largest
    'outside_box': 'x y z x y z',
    'inside_sphere': 'x y z radius',
    'outside_sphere': 'x y z radius',
}
_FARTHEST = 100.0  # [m]

BOX = 'box'  # what is drawn
SPHERE = 'sphere'

_PLANE = 3.0  # [m], width of a plane that has no end
_TABLE = 1.0  # [m], width of a surface that the tip can touch
_THICKNESS = 0.001  # [m]


class Shape(NamedTuple):
    """A shape of a scene."""

    kind: str  # in OBSTACLES or WALLS
    numbers: tuple[Meters, ...]


def read_shapes(text: str, kinds: dict[str, str]) -> list[Shape]:
    """The shapes of a text. Raises ArrayError for one that is not of these kinds, or of no size."""
    return [_shape(words, kinds) for words in map(str.split, text.split(';')) if words]


def _shape(words: list[str], kinds: dict[str, str]) -> Shape:
    kind, *rest = words
    if kind not in kinds:
        raise ArrayError(f'unknown shape {kind!r}; allowed: {", ".join(kinds)}')
    try:
        numbers = tuple(map(float, rest))
    except ValueError:
        numbers = ()
    are_near = all(abs(number) <= _FARTHEST for number in numbers)
    if len(numbers) != len(kinds[kind].split()) or not are_near:
        raise ArrayError(
            f'got the shape {" ".join(words)!r}; expected {kind} {kinds[kind]}, up to {_FARTHEST:g}'
        )
    if not _has_size(kind, np.array(numbers)):
        raise ArrayError(
            f'the shape {" ".join(words)!r} has no size; expected a normal, a radius above zero, '
            'or least x y z before largest x y z'
        )
    return Shape(kind, numbers)


def _has_size(kind: str, numbers: np.ndarray) -> bool:
    if kind == 'half_space':
        return bool(numbers[:3].any())
    if 'box' in kind:
        return bool((numbers[:3] < numbers[3:]).all())
    return 'sphere' not in kind or bool(numbers[3] > 0.0)


class DrawnShape(NamedTuple):
    """A shape to draw in the frame of the base."""

    kind: str  # BOX or SPHERE
    centre: Position
    size: Position  # edges of a box, or a sphere's diameter three times
    keeps_in: bool = False  # whether the arm stays inside; else outside
    quaternion: Quaternion = np.array((0.0, 0.0, 0.0, 1.0))
    is_solid: bool = False  # whether the tip can touch it


def shapes_of(value: Callable[[str], Any]) -> Iterator[DrawnShape]:
    """The shapes of the limits that are on, by the value of each of the controller's parameters."""
    limits = value('limits')
    shapes = []
    if 'collision' in limits:
        shapes += read_shapes(value('scene.obstacles'), OBSTACLES)
    if 'workspace' in limits:
        shapes += read_shapes(value('scene.walls'), WALLS)
    yield from map(_drawn, shapes)


def touched(value: Callable[[str], Any]) -> Iterator[DrawnShape]:
    """The surface that the tip can touch, if any, by each of the fake robot's parameters."""
    shape = value('contact_shape')
    centre = np.array(value('contact_position'))
    if shape != 'none':
        normal = (0.0, 0.0, 1.0) if shape == 'table' else (-centre[0], -centre[1], 0.0)
        plate = _plate(np.array(normal), centre)
        yield plate._replace(size=np.array((_TABLE, _TABLE, _THICKNESS)), is_solid=True)


def _drawn(shape: Shape) -> DrawnShape:
    numbers = np.array(shape.numbers)
    keeps_in = shape.kind.startswith('inside')
    if 'sphere' in shape.kind:
        return DrawnShape(SPHERE, numbers[:3], np.full(3, 2.0 * numbers[3]), keeps_in)
    if 'box' in shape.kind:
        lower, upper = np.split(numbers, 2)
        return DrawnShape(BOX, (lower + upper) / 2.0, upper - lower, keeps_in)
    if shape.kind == 'floor':
        height = shape.numbers[0] - _THICKNESS / 2.0
        return _plate(np.array((0.0, 0.0, 1.0)), np.array((0.0, 0.0, height)))
    *normal, offset = numbers / np.linalg.norm(numbers[:3])
    return _plate(np.array(normal), offset * np.array(normal))


def _plate(normal: np.ndarray, centre: np.ndarray) -> DrawnShape:
    """A plate at a centre (3,) [m] that is turned from z to a normal (3,) of any length."""
    turn = pin.Quaternion.FromTwoVectors(np.array((0.0, 0.0, 1.0)), normal)
    size = np.array((_PLANE, _PLANE, _THICKNESS))
    return DrawnShape(BOX, centre, size, quaternion=turn.coeffs())
