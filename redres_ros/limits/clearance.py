"""Distances that are kept: a velocity damper and a distance to brake for each near pair; and those
of the limit `collision`: of the arm from itself, a floor and spheres.
"""

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from types import ModuleType
from typing import NamedTuple

import numpy as np

from redres_ros.errors import ArrayError
from redres_ros.kernels.clearance import brake, braking_rows, damper_rows, farthest_path
from redres_ros.limits.joint import AccelerationFigures
from redres_ros.limits.limit import ReferenceState, RowLimit
from redres_ros.parameter import param
from redres_ros.robot_model import RobotState
from redres_ros.robots.bodies import Bodies
from redres_ros.robots.kinematics import Kinematics
from redres_ros.solver import Rows

# Of the row that bounds a joint's acceleration, beside those of distances
_OWN_WEIGHT = 1e-3

# Of the path of a braking arm: how often it is looked at, and the most places between its ends that
# get rows
_LOOKS = 16
_MOST_PLACES = 5

_POSTURES = 3  # random ones, in which a pair that a joint may bring nearer shows that

_FLOOR = -1  # in place of a second body: it is the first wall

_ClearanceRows = tuple[np.ndarray, np.ndarray, np.ndarray]
Near = tuple[np.ndarray, np.ndarray, np.ndarray]  # C (r, n), distance (r,) [m], who (r, 2)


class _Place(NamedTuple):
    """A place on the path of a braking arm.

    Attributes:
        v: The velocity of braking in the first tick, (n,) [rad/s].
        slope: S, of the joint positions there by v, (n,) [s].
        ticks: For how long it has braked.
        near: All pairs that this tick may bring too near.
    """

    v: np.ndarray
    slope: np.ndarray
    ticks: float
    near: Near


class Scene(NamedTuple):
    """What moves and what it may collide with, as kernels/distances.py describes these arrays."""

    before: np.ndarray
    axes: np.ndarray
    is_prismatic: np.ndarray
    parents: np.ndarray
    moved_by: np.ndarray
    ends: np.ndarray
    radius: np.ndarray
    pairs: np.ndarray
    walls: np.ndarray

    @classmethod
    def of(
        cls,
        kinematics: Kinematics,
        moved_by: Sequence[int],
        ends: np.ndarray,
        radius: np.ndarray,
        pairs: Sequence[Sequence[int]],
        walls: np.ndarray,
    ) -> 'Scene':
        """A scene of bodies that these joints move.

        Pairs that no joint brings nearer are left out, such as a base that stands on the floor.

        Args:
            kinematics: The joints.
            moved_by: The last joint that moves each body, B of them.
            ends: (B, 2, 3) [m].
            radius: (B,) [m].
            pairs: P of them.
            walls: (W, 7).
        """
        joints = kinematics.joints
        every = cls(
            np.array([joint.before for joint in joints]),
            np.array([joint.axis for joint in joints]),
            np.array([joint.is_prismatic for joint in joints]),
            np.array([joint.parent for joint in joints], np.int64),
            np.array(moved_by, np.int64),
            np.ascontiguousarray(ends, np.float64),
            np.ascontiguousarray(radius, np.float64),
            np.array(pairs, np.int64).reshape(-1, 2),
            np.ascontiguousarray(walls, np.float64).reshape(-1, 7),
        )
        changed: set[tuple[int, int]] = set()
        for q in np.random.default_rng(0).uniform(-1.0, 1.0, (_POSTURES, kinematics.n)):
            _, _, who = distance_kernels().approaches(q, np.inf, *every)
            changed.update(map(tuple, who.tolist()))
        kept = [tuple(pair) in changed for pair in every.pairs.tolist()]
        return every._replace(pairs=every.pairs[kept])


@dataclass(frozen=True, eq=False)
class ClearanceLimit(AccelerationFigures, RowLimit):
    """C dq <= (d - d_s) / t_d for all that is nearer than d_i, and d >= d_s while the joints brake.

    C dq is the speed at which a distance d becomes smaller. The nearer, the slower the approach; at
    d_s there is none, and below it they go apart. The second condition is that of the limit
    `position`, for distances in place of joint positions: the arm can always stop in time, unless
    obstacles move, limits are tightened, commands get lost, or the limit `jerk` makes braking take
    longer. `scale` acts on the speed and on the accelerations.

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
        self.rows(RobotState(self.model, zeros, zeros), 1.0)

    @property
    @abstractmethod
    def scene(self) -> Scene:
        """What may come near what; always the same."""

    @cached_property
    def levers(self) -> np.ndarray:
        """How far a radian of each joint moves any point of the arm, at most, (n,) [m]."""
        return self.model.kinematics.levers

    @cached_property
    def lever(self) -> float:
        """The longest of them [m]."""
        return float(self.levers.max())

    def approaches(self, q: np.ndarray, reach: float) -> Near:
        """What is nearer than `reach`: C dq is the speed of approach [m/s]; who approaches whom.

        Args:
            q: (n,) [rad].
            reach: [m].
        """
        return distance_kernels().approaches(q, reach, *self.scene)

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

    def can_be_kept(self, dq: np.ndarray, state: ReferenceState, T: float) -> bool:
        """Whether no pair comes nearer than d_s, or than by braking at once, if the joints brake
        after this tick. The rows are of first order, and of some places on the path; this is exact
        in each tick.
        """
        least, _ = self._least(state, dq, T, 1, self.clearance)
        if not least.min(initial=np.inf) < self.clearance:
            return True
        braking = self._braked(state, T, np.inf)
        least_braking, _ = self._least(state, braking.v, T, 1, self.clearance)
        return bool((least >= np.minimum(least_braking, self.clearance)).all())

    def clearance_rows(self, state: ReferenceState, T: float) -> _ClearanceRows:
        """Rows C dq <= high for which the arm keeps its clearance.

        Those that the acceleration limits imply are left out. There are two kinds, with d the
        distance of a pair and d_s the clearance. At q, of pairs nearer than the influence, the
        velocity damper C dq <= rate (d - d_s), with C in the middle of the tick, q + T dq_prev / 2:
        a fast arm leaves the tangent of its path at q. And d >= d_s while the joints brake by A
        from the next tick on: after this tick, where they come to rest, and where pairs are nearest
        between. They come to rest one after the other, so that an arm may pass a wall and turn
        back. To first order in dq, about the velocity v of braking already in this tick,

            C S (dq - v) <= d(q + s(v)) - d_s - b,

        with s(v) the path to such a place and S = ds/dv. The margin b = 1/2 lever |T S A|^2 is of
        second order: how far the arm leaves its tangent. Braking, dq = v, does not change the path,
        so it keeps d >= d_s if the tick before did. That is why these rows can be kept for ever,
        however many pairs there are.

        Args:
            state: Of the reference at this tick.
            T: Sampling time [s].

        Returns:
            C (r, n), high (r,), and who approaches whom (r, 2).
        """
        half = 0.5 * T * state.tick.gap * state.dq_prev
        farthest = farthest_path(state.dq_prev, state.tick.gap, self.A, T, self.levers)
        reach = max(self.influence, self.clearance + farthest) + farthest
        C, at_half, who = self.approaches(state.q + half, reach)
        distance = at_half + C.dot(half)
        figures = (self._rate, self.clearance)
        found = [damper_rows(C, distance, who, state.dq_prev, self.A, T, *figures, self.influence)]
        if distance.min(initial=np.inf) <= self.clearance + farthest:
            for place in self._nearest_places(state, T):
                braking = (place.v, place.slope, self.A, T, state.tick.gap, place.ticks)
                found.append(
                    braking_rows(*place.near, distance, who, *braking, *figures, self.lever)
                )
        rows, high, pairs = zip(*found, strict=True)
        return np.concatenate(rows), np.concatenate(high), np.concatenate(pairs)

    def _nearest_places(self, state: ReferenceState, T: float) -> Iterator[_Place]:
        """Where the joints come to rest if they brake, after this tick, and where pairs are nearest
        between.

        Args:
            state: Of the reference at this tick.
            T: Sampling time [s].
        """
        rest = self._braked(state, T, np.inf)
        yield rest
        if rest.ticks == 1.0:
            return
        yield self._braked(state, T, 1.0)
        step = 1 + int(rest.ticks) // _LOOKS
        near = self.clearance + self._change(rest.slope, state, T)
        least, ticks = self._least(state, rest.v, T, step, near)
        taken = [1.0, rest.ticks]
        for pair in np.argsort(least).tolist():
            if least[pair] > near or len(taken) == 2 + _MOST_PLACES:
                return
            if min(abs(ticks[pair] - each) for each in taken) > step:
                taken.append(ticks[pair])
                yield self._braked(state, T, ticks[pair])

    def _change(self, slope: np.ndarray, state: ReferenceState, T: float) -> float:
        """How far a place on the path of a braking arm may move in this tick, at most [m].

        Args:
            slope: Of the place, (n,) [s].
            state: Of the reference at this tick.
            T: Sampling time [s].
        """
        steps = (slope + state.tick.gap * T) * self.A * T
        first_order = 2.0 * float(self.levers.dot(steps))
        return first_order + 0.5 * self.lever * float(steps.dot(steps))

    def _least(
        self, state: ReferenceState, dq: np.ndarray, T: float, step: int, enough: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """The least distance of each pair (P,) [m] on the path of joints that move by dq and then
        brake, and after how many ticks, (P,).

        Args:
            state: Of the reference at this tick.
            dq: (n,) [rad/s].
            T: Sampling time [s].
            step: Ticks from one look to the next.
            enough: Distance from which on it need not be exact [m].
        """
        path = (state.q, dq, self.A, T, state.tick.gap, self.levers)
        least, ticks = distance_kernels().least_on_path(*path, step, enough, *self.scene)
        return least, ticks

    def _braked(self, state: ReferenceState, T: float, ticks: float) -> _Place:
        """Where the arm is that has braked for so many ticks, this one included; infinity: at rest.

        Args:
            state: Of the reference at this tick.
            T: Sampling time [s].
            ticks: Their number.
        """
        q, v, slope = np.empty((3, len(state.q)))
        longest = brake(state.q, state.dq_prev, state.tick.gap, self.A, T, ticks, q, v, slope)
        near = self.approaches(q, self.clearance + self._change(slope, state, T))
        return _Place(v, slope, min(ticks, longest), near)

    @property
    def _rate(self) -> float:
        """1 / t_d [1/s]."""
        return self.scale / self.time


@dataclass(frozen=True, eq=False)
class CollisionLimit(ClearanceLimit):
    """n' (J_a - J_b) dq <= (d - d_s) / t_d for each pair of bodies nearer than d_i, and d >= d_s
    while the joints brake.

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
    def scene(self) -> Scene:
        """The bodies, and balls that no joint moves after them; the floor is a wall."""
        bodies = self.bodies
        balls = self._balls
        number = len(bodies.links)
        pairs = bodies.pairs(self.influence).tolist()
        for body in range(number):
            pairs.append([body, _FLOOR])
            pairs.extend([body, number + ball] for ball in range(len(balls)))
        kinds = distance_kernels()
        return Scene.of(
            self.model.kinematics,
            [*(bodies.moved_by - 1), *[kinds.BASE] * len(balls)],
            np.concatenate((bodies.ends, np.repeat(balls[:, None, :3], 2, axis=1))),
            np.concatenate((bodies.radius, balls[:, 3])),
            pairs,
            np.array((kinds.HALF_SPACE, 0.0, 0.0, -1.0, -self.floor, 0.0, 0.0)),
        )

    @cached_property
    def _balls(self) -> np.ndarray:
        """Centres and radii of the obstacles, (S, 4) [m]."""
        balls = np.reshape(np.array(self.spheres, np.float64), (-1, 4))
        return balls[balls[:, 3] > 0.0]

    def name_of_pair(self, one: int, other: int) -> str:
        return f'{self.bodies.links[one]} to {self._name(other)}'

    def _name(self, other: int) -> str:
        if other == _FLOOR:
            return 'floor'
        links = self.bodies.links
        return links[other] if other < len(links) else f'ball {other - len(links) + 1}'


@lru_cache(maxsize=1)  # the name of a row is asked for right after the rows
def _rows_at(limit: ClearanceLimit, state: ReferenceState, T: float) -> _ClearanceRows:
    return limit.clearance_rows(state, T)


def distance_kernels() -> ModuleType:
    """The compiled kernels. They are loaded only if such a limit is used."""
    from redres_ros.kernels import distances

    return distances
