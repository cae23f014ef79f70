"""Collision avoidance with itself, the floor, and spheres: a velocity damper for each pair."""

from dataclasses import dataclass
from functools import cached_property
from types import ModuleType
from typing import Any

import numpy as np

from redres_ros.errors import ArrayError
from redres_ros.limits.clearance import ClearanceLimit, Near
from redres_ros.parameter import param
from redres_ros.robots.bodies import Bodies


@dataclass(frozen=True, eq=False)
class CollisionLimit(ClearanceLimit):
    """n' (J_a - J_b) dq <= (d - d_s) / t_d for each pair of bodies nearer than d_i, and d >= d_s
    where the joints come to rest if they brake.

    d is their distance, n the direction from the nearest point of a to that of b, J_a and J_b the
    Jacobians of these points. Bodies are capsules around the arm's links.

    Raises:
        ArrayError: An arm with several tips, spheres of the wrong shape, or a clearance that is not
            below the influence.
    """

    floor: float = param(-10.0, 'height of a floor in the base frame [m]', -10.0, 10.0, live=True)
    spheres: tuple[float, ...] = param(
        (0.0, 0.0, 0.0, 0.0),
        'obstacles: x, y, z of the centre and the radius of each ball [m]; radius 0 for none',
        -100.0,
        100.0,
        live=True,
    )

    def __post_init__(self) -> None:
        if self.model.arm.other_tips:
            raise ArrayError(
                f'the limit collision knows arms with one tip; {self.model.arm.source} has also '
                f'{", ".join(self.model.arm.other_tips)}'
            )
        super().__post_init__()
        if len(self.spheres) % 4:
            raise ArrayError(
                f'spheres holds {len(self.spheres)} numbers; '
                'expected four for each sphere: x, y, z and radius'
            )
        self._load()

    @cached_property
    def bodies(self) -> Bodies:
        """Of the arm."""
        return self.model.bodies

    @cached_property
    def _scene(self) -> tuple[Any, ...]:
        """The joints, the bodies and what they may collide with, as `approaches` takes them.

        Balls are bodies that no joint moves, after those of the arm.
        """
        joints = self.model.kinematics.joints
        bodies = self.bodies
        balls = self._balls
        centres = np.repeat(balls[:, None, :3], 2, axis=1)
        number = len(bodies.links)
        pairs = bodies.pairs(self.influence).tolist()
        for body in range(number):
            pairs.append([body, _distances().FLOOR])
            pairs.extend([body, number + ball] for ball in range(len(balls)))
        return (
            np.array([joint.before for joint in joints]),
            np.array([joint.axis for joint in joints]),
            np.array([joint.is_prismatic for joint in joints]),
            np.concatenate((bodies.moved_by, np.zeros(len(balls), np.int64))),
            np.concatenate((bodies.ends, centres)),
            np.concatenate((bodies.radius, balls[:, 3])),
            np.array(pairs, np.int64),
            float(self.floor),
        )

    @cached_property
    def _balls(self) -> np.ndarray:
        """Centres and radii of the obstacles, (S, 4) [m]."""
        balls = np.reshape(np.array(self.spheres, np.float64), (-1, 4))
        return balls[balls[:, 3] > 0.0]

    def approaches(self, q: np.ndarray, reach: float) -> Near:
        found: Near = _distances().approaches(q, *self._scene, reach)
        return found

    def name_of_pair(self, one: int, other: int) -> str:
        return f'{self.bodies.links[one]} to {self._name(other)}'

    def _name(self, other: int) -> str:
        if other == _distances().FLOOR:
            return 'floor'
        links = self.bodies.links
        return links[other] if other < len(links) else f'ball {other - len(links) + 1}'


def _distances() -> ModuleType:
    """The compiled kernels. They are loaded only if this limit is used."""
    from redres_ros.kernels import distances

    return distances
