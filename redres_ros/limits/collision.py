"""Collision avoidance with itself, the floor, and spheres: a velocity damper for each pair."""

from dataclasses import dataclass
from functools import cached_property
from types import ModuleType

import numpy as np

from redres_ros.constrained import Rows
from redres_ros.errors import ArrayError
from redres_ros.limits.limit import ReferenceState, RowLimit
from redres_ros.parameter import param
from redres_ros.robots.bodies import Bodies

Near = tuple[np.ndarray, np.ndarray, np.ndarray]  # C (r, n), distance (r,) [m], who (r, 2)


@dataclass(frozen=True, eq=False)
class CollisionLimit(RowLimit):
    """n' (J_a - J_b) dq <= (d - d_s) / t_d for each pair of bodies nearer than d_i.

    d is their distance, n the way from the nearest point of a to that of b, J_a and J_b the
    Jacobians of these points. The nearer they are, the slower they may approach; at d_s not at all,
    and below it they go apart. Bodies are capsules around the arm's links; `scale` acts on the
    speed.

    Raises:
        ArrayError: An arm with several tips, balls of the wrong shape, or a clearance that is not
            below the influence.
    """

    order = 0
    holds_in_a_stop = True

    influence: float = param(
        0.1, 'd_i, distance below which an approach is slowed down [m]', 0.001, 1.0, live=True
    )
    clearance: float = param(0.02, 'd_s, distance that is kept [m]', 0.0, 1.0, live=True)
    time: float = param(
        0.3, 't_d, time in which what is left to d_s may be covered [s]', 0.01, 10.0, live=True
    )
    floor: float = param(-10.0, 'height of a floor in the base frame [m]', -10.0, 10.0, live=True)
    spheres: tuple[float, ...] = param(
        (0.0, 0.0, 0.0, 0.0),
        'obstacles: x, y, z of the centre and the radius of each ball [m]; radius 0 for none',
        -100.0,
        100.0,
        live=True,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.model.arm.other_tips:
            raise ArrayError(
                f'the limit collision knows arms with one tip; {self.model.arm.source} has also '
                f'{", ".join(self.model.arm.other_tips)}'
            )
        if len(self.spheres) % 4:
            raise ArrayError(
                f'balls holds {len(self.spheres)} numbers; '
                'expected four for each ball: x, y, z and radius'
            )
        if not self.clearance < self.influence:
            raise ArrayError(
                f'the clearance is {self.clearance:g} m; '
                f'expected less than the influence, {self.influence:g} m'
            )
        _distances()  # now, and not in the loop

    @cached_property
    def bodies(self) -> Bodies:
        """Of the arm."""
        return self.model.arm.bodies()

    @cached_property
    def _pairs(self) -> np.ndarray:
        return self.bodies.pairs(self.influence)

    @cached_property
    def _balls(self) -> np.ndarray:
        return np.reshape(self.spheres, (-1, 4))

    def near(self, state: ReferenceState) -> Near:
        """What is nearer than d_i: C dq is the speed of approach [m/s]."""
        bodies = self.bodies
        found: Near = _distances().approaches(
            state.joint_poses,
            bodies.moved_by,
            bodies.ends,
            bodies.radius,
            self._pairs,
            self.floor,
            self._balls,
            state.J,
            state.x,
            self.influence,
        )
        return found

    def rows(self, state: ReferenceState, T: float) -> Rows:
        C, distance, _ = self.near(state)
        fastest = self.scale * (distance - self.clearance) / self.time  # (r,) [m/s]
        return C, np.full(len(C), -np.inf), fastest

    def place(self, state: ReferenceState, index: int) -> str:
        """As 'link_5 to floor'."""
        _, _, who = self.near(state)
        i, other = who[index].tolist()
        return f'{self.bodies.links[i]} to {self._name(other)}'

    def _name(self, other: int) -> str:
        distances = _distances()
        if other == distances.FLOOR:
            return 'floor'
        if other <= distances.FIRST_SPHERE:
            return f'ball {distances.FIRST_SPHERE - other + 1}'
        return self.bodies.links[other]


def _distances() -> ModuleType:
    """The compiled kernels. They are loaded only if this limit is used."""
    from redres_ros.kernels import distances

    return distances
