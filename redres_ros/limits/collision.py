"""Collision avoidance with itself, the floor, and spheres: a velocity damper for each pair."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from types import ModuleType
from typing import Any

import numpy as np

from redres_ros.constrained import Rows
from redres_ros.errors import ArrayError
from redres_ros.limits.joint import AccelerationFigures
from redres_ros.limits.limit import ReferenceState, RowLimit
from redres_ros.parameter import param
from redres_ros.robots.bodies import Bodies

# Of the row that bounds a joint's acceleration, beside those of distances
_OWN_WEIGHT = 1e-3

CollisionRows = tuple[np.ndarray, np.ndarray, np.ndarray]
Near = tuple[np.ndarray, np.ndarray, np.ndarray]  # C (r, n), distance (r,) [m], who (r, 2)


@dataclass(frozen=True, eq=False)
class CollisionLimit(AccelerationFigures, RowLimit):
    """n' (J_a - J_b) dq <= (d - d_s) / t_d for each pair of bodies nearer than d_i, and d >= d_s
    where the joints come to rest if they brake.

    d is their distance, n the way from the nearest point of a to that of b, J_a and J_b the
    Jacobians of these points. The nearer they are, the slower they may approach; at d_s not at all,
    and below it they go apart. The second condition is that of the limit `position`, for distances
    in place of joint positions: the arm can always stop in time (kernels/distances.py). Bodies are
    capsules around the arm's links; `scale` acts on the speed and on the accelerations.

    Where no acceleration limit is in force, this limit keeps the accelerations itself while
    anything is near, as well as the distances allow: joints that may jump would swing between two
    ways round an obstacle.

    Args:
        acceleration_is_limited: Whether an acceleration limit is in force.

    Raises:
        ArrayError: An arm with several tips, balls of the wrong shape, or a clearance that is not
            below the influence.
    """

    order = 0
    holds_in_a_stop = True

    acceleration_is_limited: bool = False
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
        if self.model.arm.other_tips:
            raise ArrayError(
                f'the limit collision knows arms with one tip; {self.model.arm.source} has also '
                f'{", ".join(self.model.arm.other_tips)}'
            )
        super().__post_init__()
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
    def _shapes(self) -> tuple[Any, Any]:
        """The joints and the bodies, as the compiled functions take them."""
        distances = _distances()
        kinematics = self.model.arm.kinematics()
        bodies = self.bodies
        chain = distances.Chain(
            np.array([joint.before for joint in kinematics.joints]),
            np.array([joint.axis for joint in kinematics.joints]),
            np.array([joint.is_prismatic for joint in kinematics.joints]),
        )
        shapes = distances.Shapes(
            bodies.moved_by,
            bodies.ends,
            bodies.radius,
            bodies.pairs(self.influence),
            np.reshape(np.array(self.spheres, np.float64), (-1, 4)),
            float(self.floor),
            float(np.linalg.norm(kinematics.ways, axis=1).sum()),
        )
        return chain, shapes

    def near(self, state: ReferenceState) -> Near:
        """What is nearer than d_i: C dq is the speed of approach [m/s]."""
        found: Near = _distances().approaches(state.q, *self._shapes, self.influence)
        return found

    def rows(self, state: ReferenceState, T: float) -> Rows:
        C, high, _ = _rows_at(self, state, T)
        low = np.full(len(C), -np.inf)
        if self.acceleration_is_limited or not len(C):
            return C, low, high
        own = _OWN_WEIGHT * np.eye(len(state.q))
        steps = _OWN_WEIGHT * T * self.A
        middle = _OWN_WEIGHT * state.dq_prev
        return (
            np.concatenate((C, own)),
            np.concatenate((low, middle - steps)),
            np.concatenate((high, middle + steps)),
        )

    def place(self, state: ReferenceState, index: int, T: float) -> str:
        """As 'link_5 to floor'; of a row that bounds an acceleration the joint."""
        _, _, who = _rows_at(self, state, T)
        if index >= len(who):
            return super().place(state, index - len(who), T)
        i, other = who[index].tolist()
        return f'{self.bodies.links[i]} to {self._name(other)}'

    def collision_rows(self, state: ReferenceState, T: float) -> CollisionRows:
        """C (r, n), high (r,), and who approaches whom (r, 2).

        Args:
            state: Of the reference at this tick.
            T: Sampling time [s].
        """
        found: CollisionRows = _distances().collision_rows(
            state.q,
            state.dq_prev,
            self.A,
            T,
            state.gap,
            *self._shapes,
            self.influence,
            self.clearance,
            self.scale / self.time,
        )
        return found

    def _name(self, other: int) -> str:
        distances = _distances()
        if other == distances.FLOOR:
            return 'floor'
        if other <= distances.FIRST_SPHERE:
            return f'ball {distances.FIRST_SPHERE - other + 1}'
        return self.bodies.links[other]


@lru_cache(maxsize=1)  # the name of a row is asked for right after the rows
def _rows_at(limit: CollisionLimit, state: ReferenceState, T: float) -> CollisionRows:
    return limit.collision_rows(state, T)


def _distances() -> ModuleType:
    """The compiled kernels. They are loaded only if this limit is used."""
    from redres_ros.kernels import distances

    return distances
