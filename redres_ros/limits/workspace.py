"""Walls: points of the arm stay inside or outside of boxes, spheres and half-spaces."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from redres_ros.errors import ArrayError, UnknownNameError
from redres_ros.limits.clearance import ClearanceLimit, Scene, distance_kernels
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
    """All walls: their names, and the rows that kernels/distances.py describes.

    The faces of boxes to stay in are half-spaces.
    """

    names: tuple[str, ...]
    rows: np.ndarray


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

    @cached_property
    def scene(self) -> Scene:
        """The points, each of which may come near each wall."""
        kinematics = self.model.kinematics
        placed = [kinematics.links[frame] for frame in self._frames]
        points = np.array([pose[:3, 3] for _, pose in placed])
        _, walls = self._walls
        return Scene.of(
            kinematics,
            [joint for joint, _ in placed],
            np.repeat(points[:, None], 2, axis=1),
            np.zeros(len(points)),
            [(i, -1 - w) for i in range(len(points)) for w in range(len(walls))],
            walls,
        )

    def name_of_pair(self, one: int, other: int) -> str:
        return f'{self._frames[one]} to {self._walls.names[-1 - other]}'

    @cached_property
    def _frames(self) -> tuple[str, ...]:
        """The links whose origins are the points."""
        known = {TIP: self.model.arm.tip_frame}
        names = [name.strip() for name in self.points.split(',')]
        if _ELBOW in names:
            known[_ELBOW] = self.model.elbow_frame
        frames = tuple(known.get(name, name) for name in names)
        for frame in frames:
            if frame not in self.model.kinematics.links:
                raise UnknownNameError('frame', frame, self.model.links)
        return frames

    @cached_property
    def _walls(self) -> _Walls:
        half_spaces = self._shapes_in('half_spaces', 4)
        lengths = np.linalg.norm(half_spaces[:, :3], axis=1)
        half_spaces = half_spaces[lengths > 0.0] / lengths[lengths > 0.0, None]
        inside = self._boxes('inside_boxes')
        outside = self._boxes('outside_boxes')
        spheres_in = self._spheres('inside_spheres')
        spheres_out = self._spheres('outside_spheres')
        names = (
            *_numbered('half-space', len(half_spaces)),
            *(f'{face} of inside box {k + 1}' for k in range(len(inside)) for face in _FACES),
            *_numbered('outside box', len(outside)),
            *_numbered('inside sphere', len(spheres_in)),
            *_numbered('outside sphere', len(spheres_out)),
        )
        kinds = distance_kernels()
        rows = [[kinds.HALF_SPACE, *each, 0.0, 0.0] for each in half_spaces]
        for lower, upper in inside:
            for inwards, end in zip(_INWARDS, (*-lower, *upper), strict=True):
                rows.append([kinds.HALF_SPACE, *-inwards, end, 0.0, 0.0])
        rows.extend([kinds.BOX, *lower, *upper] for lower, upper in outside)
        for side, spheres in ((1.0, spheres_in), (-1.0, spheres_out)):
            rows.extend([kinds.SPHERE, *each, side, 0.0] for each in spheres)
        return _Walls(names, np.array(rows).reshape(-1, 7))

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
        """Least and largest x, y, z of the boxes in a field, (b, 2, 3) [m]."""
        boxes = self._shapes_in(name, 6).reshape(-1, 2, 3)
        for lower, upper in boxes:
            if not (lower <= upper).all():
                raise ArrayError(
                    f'{name}: {lower.tolist()} is not below {upper.tolist()}; expected least '
                    'x, y, z before largest x, y, z'
                )
        return boxes[(boxes[:, 0] < boxes[:, 1]).any(axis=1)]


def _numbered(kind: str, count: int) -> list[str]:
    return [f'{kind} {k + 1}' for k in range(count)]
