"""Distances that are kept: a velocity damper and a distance to brake for each near pair; and those
of the limit `collision`: of the arm from itself, a floor and spheres.
"""

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property, lru_cache
from types import ModuleType
from typing import Any

import numpy as np

from redres_ros.constrained import Rows
from redres_ros.errors import ArrayError
from redres_ros.kernels.clearance import brake, clearance_rows
from redres_ros.limits.joint import AccelerationFigures
from redres_ros.limits.limit import ReferenceState, RowLimit
from redres_ros.parameter import param
from redres_ros.robots.bodies import Bodies

# Of the row that bounds a joint's acceleration, beside those of distances
_OWN_WEIGHT = 1e-3

_ClearanceRows = tuple[np.ndarray, np.ndarray, np.ndarray]
Near = tuple[np.ndarray, np.ndarray, np.ndarray]  # C (r, n), distance (r,) [m], who (r, 2)


@dataclass(frozen=True, eq=False)
class ClearanceLimit(AccelerationFigures, RowLimit):
    """C dq <= (d - d_s) / t_d for all that is nearer than d_i, and d >= d_s where the joints rest
    after braking.

    C dq is the speed at which a distance d becomes smaller. The nearer, the slower the approach; at
    d_s there is none, and below it they go apart. The second condition is that of the limit
    `position`, for distances in place of joint positions: the arm can always stop in time. `scale`
    acts on the speed and on the accelerations.

    Where no acceleration limit is in force, this limit keeps the accelerations itself while
    anything is near, as well as the distances allow: joints that may jump would swing between two
    ways round an obstacle.

    Args:
        acceleration_is_limited: Whether an acceleration limit is in force.

    Raises:
        ArrayError: A clearance that is not below the influence.
    """

    order = 0
    holds_in_a_stop = True

    acceleration_is_limited: bool = False
    influence: float = param(
        0.1, 'd_i, distance below which an approach is slowed down [m]', 0.001, 1.0, live=True
    )
    clearance: float = param(0.02, 'd_s, least distance [m]', 0.0, 1.0, live=True)
    time: float = param(0.3, 't_d, time constant of the approach to d_s [s]', 0.01, 10.0, live=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.clearance < self.influence:
            raise ArrayError(
                f'the clearance is {self.clearance:g} m; '
                f'expected less than the influence, {self.influence:g} m'
            )

    def _load(self) -> None:
        """Read the URDF, and load compiled functions: now, and not in the loop."""
        zeros = np.zeros(self.model.n)
        self.rows(self.model.unchecked_state(zeros, zeros), 1.0)

    @cached_property
    def lever(self) -> float:
        """How far a radian of any joint moves any point of the arm, at most [m]."""
        return float(np.linalg.norm(self.model.kinematics.offsets, axis=1).sum())

    @abstractmethod
    def approaches(self, q: np.ndarray, reach: float) -> Near:
        """What is nearer than `reach`: C dq is the speed of approach [m/s]; who approaches whom.

        Args:
            q: (n,) [rad].
            reach: [m].
        """

    @abstractmethod
    def name_of_pair(self, one: int, other: int) -> str:
        """Such as 'link_5 to floor'.

        Args:
            one: Who approaches.
            other: Whom.
        """

    def near(self, state: ReferenceState) -> Near:
        """What is nearer than d_i: C dq is the speed of approach [m/s]."""
        return self.approaches(state.q, self.influence)

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
        return self.name_of_pair(*who[index].tolist())

    def clearance_rows(self, state: ReferenceState, T: float) -> _ClearanceRows:
        """Rows C dq <= high for which the arm keeps its clearance.

        Those that the acceleration limits imply are left out. There are two kinds, with d the
        distance of a pair and d_s the clearance. At q, of pairs nearer than the influence, the
        velocity damper C dq <= rate (d - d_s), with C in the middle of the tick, q + T dq_prev / 2:
        a fast arm leaves the tangent of its path at q. And at q + s(dq), where the joints come to
        rest if they brake by A from the next tick on, d >= d_s. To first order in dq, about the
        velocity v of braking already in this tick,

            C S (dq - v) <= d(q + s(v)) - d_s,   s(v) = v |v| / (2 A) + v T / 2,

        with S = ds/dv; s is exact for v = j A T. Braking, dq = v, changes nothing about where the
        joints come to rest, so it keeps all of these rows, if those of the tick before were kept.
        That is why they can be kept for ever, however many pairs there are.

        Args:
            state: Of the reference at this tick.
            T: Sampling time [s].

        Returns:
            C (r, n), high (r,), and who approaches whom (r, 2).
        """
        half = 0.5 * T * state.gap * state.dq_prev
        C, at_half, who = self.approaches(state.q + half, self.influence)
        distance = at_half + C.dot(half)
        n = len(state.q)
        q_stop = np.empty(n)
        v = np.empty(n)
        slope = np.empty(n)
        dq_prev = state.dq_prev
        further = brake(state.q, dq_prev, state.gap, self.A, T, q_stop, v, slope)
        at_rest = self.approaches(q_stop, self.clearance + self.lever * further)
        figures = (dq_prev, v, slope, self.A, T, state.gap, self._rate, self.clearance)
        return clearance_rows(C, distance, who, *at_rest, *figures)

    @property
    def _rate(self) -> float:
        """1 / t_d [1/s]."""
        return self.scale / self.time


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
        return _distances().approaches(q, *self._scene, reach)

    def name_of_pair(self, one: int, other: int) -> str:
        return f'{self.bodies.links[one]} to {self._name(other)}'

    def _name(self, other: int) -> str:
        if other == _distances().FLOOR:
            return 'floor'
        links = self.bodies.links
        return links[other] if other < len(links) else f'ball {other - len(links) + 1}'


@lru_cache(maxsize=1)  # the name of a row is asked for right after the rows
def _rows_at(limit: ClearanceLimit, state: ReferenceState, T: float) -> _ClearanceRows:
    return limit.clearance_rows(state, T)


def _distances() -> ModuleType:
    """The compiled kernels. They are loaded only if this limit is used."""
    from redres_ros.kernels import distances

    return distances
