"""Walls: points of the arm stay inside or outside of boxes, spheres and half-spaces."""

from dataclasses import dataclass
from functools import cached_property
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from redres_ros.errors import ArrayError
from redres_ros.limits.clearance import ClearanceLimit, Near
from redres_ros.parameter import param

TIP = 'tip'
_ELBOW = 'elbow'

_FARTHEST = 100.0  # [m]
_FACES = ('-x', '-y', '-z', '+x', '+y', '+z')  # of a box
_INWARDS = np.concatenate((np.eye(3), -np.eye(3)))  # from each of them


def _shapes(size: int, description: str) -> Any:
    """A field of shapes, of so many numbers each; zeros for none: ROS knows no empty array."""
    return param((0.0,) * size, description, -_FARTHEST, _FARTHEST, live=True)


class _Walls(NamedTuple):
    """All walls: their names, and the arrays that kernels/walls.py describes, in its order.

    The faces of boxes to stay in are half-spaces.
    """

    names: tuple[str, ...]
    normals: np.ndarray
    offsets: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    centres: np.ndarray
    radii: np.ndarray
    sides: np.ndarray


@dataclass(frozen=True, eq=False)
class WorkspaceLimit(ClearanceLimit):
    """n' J dq <= (d - d_s) / t_d for each point and each wall nearer than d_i, and d >= d_s while
    the joints brake.

    d is the distance of a point from the wall, n the direction towards it, J the point's Jacobian.
    Shapes are in the base frame, and each applies to all points.

    Raises:
        ArrayError: Shapes of another number of figures, a box whose ends are exchanged, a clearance
            that is not below the influence.
        UnknownNameError: A point that is no link of the arm.
        FileError: The elbow of an arm that has none.
    """

    clearance: float = param(0.0, 'd_s, least distance [m]', 0.0, 1.0, live=True)
    points: str = param(
        TIP,
        'points that are kept inside: tip, elbow or names of links, separated by commas',
        live=True,
    )
    half_spaces: tuple[float, ...] = _shapes(
        4, 'a x + b y + c z <= d: a, b, c and d [m] of each; a = b = c = 0 for none'
    )
    inside_boxes: tuple[float, ...] = _shapes(
        6, 'least x, y, z and largest x, y, z [m] of each box to stay in; of no size for none'
    )
    outside_boxes: tuple[float, ...] = _shapes(6, 'the same of each box to stay out of')
    inside_spheres: tuple[float, ...] = _shapes(
        4, 'x, y, z of the centre and the radius [m] of each sphere to stay in; radius 0 for none'
    )
    outside_spheres: tuple[float, ...] = _shapes(4, 'the same of each sphere to stay out of')

    def __post_init__(self) -> None:
        super().__post_init__()
        self._load()

    def approaches(self, q: np.ndarray, reach: float) -> Near:
        frames = self._frames
        x = np.array([self.model.position(q, frame) for frame in frames])  # (points, 3)
        J = np.array([self.model.jacobian(q, frame)[:3] for frame in frames])  # (points, 3, n)
        _, *walls = self._walls
        return _kernel().approaches(x, J, *walls, reach)

    def name_of_pair(self, one: int, other: int) -> str:
        return f'{self._frames[one]} to {self._walls.names[other]}'

    @cached_property
    def _frames(self) -> tuple[str, ...]:
        """The links whose origins are the points."""
        known = {TIP: self.model.arm.tip_frame}
        names = [name.strip() for name in self.points.split(',')]
        if _ELBOW in names:
            known[_ELBOW] = self.model.elbow_frame
        return tuple(known.get(name, name) for name in names)

    @cached_property
    def _walls(self) -> _Walls:
        half_spaces = self._shapes_in('half_spaces', 4)
        lengths = np.linalg.norm(half_spaces[:, :3], axis=1)
        half_spaces = half_spaces[lengths > 0.0] / lengths[lengths > 0.0, None]
        inside = self._boxes('inside_boxes')  # (2, b, 3)
        lower, upper = self._boxes('outside_boxes')  # (b, 3)
        spheres_in = self._spheres('inside_spheres')
        spheres_out = self._spheres('outside_spheres')
        spheres = np.concatenate((spheres_in, spheres_out))
        b = inside.shape[1]
        names = (
            *_numbered('half-space', len(half_spaces)),
            *(f'{face} of inside box {k + 1}' for k in range(b) for face in _FACES),
            *_numbered('outside box', len(lower)),
            *_numbered('inside sphere', len(spheres_in)),
            *_numbered('outside sphere', len(spheres_out)),
        )
        ends = np.concatenate((-inside[0], inside[1]), axis=1)  # (b, 6), of -x, -y, -z, x, y, z
        return _Walls(
            names,
            np.concatenate((half_spaces[:, :3], np.tile(-_INWARDS, (b, 1)))),
            np.concatenate((half_spaces[:, 3], ends.reshape(-1))),
            lower,
            upper,
            spheres[:, :3],
            spheres[:, 3],
            np.repeat((1.0, -1.0), (len(spheres_in), len(spheres_out))),
        )

    def _shapes_in(self, name: str, size: int) -> np.ndarray:
        """The shapes in a field, (shapes, size)."""
        values = getattr(self, name)
        if len(values) % size:
            raise ArrayError(f'{name} holds {len(values)} numbers; expected {size} for each shape')
        return np.reshape(np.array(values, np.float64), (-1, size))

    def _spheres(self, name: str) -> np.ndarray:
        """Centre and radius of the spheres in a field, (s, 4) [m]."""
        spheres = self._shapes_in(name, 4)
        return spheres[spheres[:, 3] > 0.0]

    def _boxes(self, name: str) -> np.ndarray:
        """Least and largest x, y, z of the boxes in a field, (2, b, 3) [m]."""
        boxes = self._shapes_in(name, 6).reshape(-1, 2, 3)
        for lower, upper in boxes:
            if not (lower <= upper).all():
                raise ArrayError(
                    f'{name}: {lower.tolist()} is not below {upper.tolist()}; expected least '
                    'x, y, z before largest x, y, z'
                )
        has_size = (boxes[:, 0] < boxes[:, 1]).any(axis=1)
        return boxes[has_size].transpose(1, 0, 2)


def _numbered(kind: str, count: int) -> list[str]:
    return [f'{kind} {k + 1}' for k in range(count)]


def _kernel() -> ModuleType:
    """The compiled function. It is loaded only if this limit is used."""
    from redres_ros.kernels import walls

    return walls
