"""Distances that are kept: of the arm's bodies from each other and from obstacles (the limit
`collision`), and of points of the arm from walls (`workspace`). A point is a body of radius zero.
"""

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from types import ModuleType
from typing import NamedTuple

import numpy as np

from redres_ros.errors import ArrayError, UnknownNameError
from redres_ros.limits.joint import BrakingLimit
from redres_ros.limits.limit import ReferenceState
from redres_ros.parameter import param
from redres_ros.robots.kinematics import Kinematics
from redres_ros.robots.scene import OBSTACLES, WALLS, Shape, read_shapes
from redres_ros.solver import Rows
from redres_ros.types import JointPositions, JointVelocities, Meters, Seconds

# The distance d_i below which an approach is slowed down [m], at least twice the clearance; its
# time constant t_d [s]; and what stays free beside the clearance [m], for joints that come to rest
# one after the other. They make an approach calm; it is braking by A that keeps the clearance.
_INFLUENCE = 0.1
_TIME = 0.3
_FREE = 5e-4

# Of the row that bounds a joint's acceleration, beside those of distances
_OWN_WEIGHT = 1e-3

# Of the path of a braking arm: how often it is looked at, and the most places that get rows
_LOOKS = 16
_MOST_PLACES = 7

_POSTURES = 3  # random ones, in which a pair that a joint may bring nearer shows that

_FACES = ('-x', '-y', '-z', '+x', '+y', '+z')  # of a box

_ClearanceRows = tuple[np.ndarray, np.ndarray, np.ndarray]
_Near = tuple[np.ndarray, np.ndarray, np.ndarray]  # C (r, n), distance (r,) [m], which pair (r,)


class _Place(NamedTuple):
    """A place on the path of a braking arm."""

    v: JointVelocities  # of braking in the first tick
    slope: np.ndarray  # S, of the joint positions there by v, (n,) [s]
    ticks: float  # for how long it has braked
    near: _Near  # all pairs that this tick may bring too near


class _Scene(NamedTuple):
    """What moves and what it may collide with, as kernels/distances.py describes these arrays."""

    joints: np.ndarray
    bodies: np.ndarray
    pairs: np.ndarray
    walls: np.ndarray

    @classmethod
    def made(
        cls,
        kinematics: Kinematics,
        moved_by: Sequence[int],
        ends: np.ndarray,
        radius: np.ndarray,
        pairs: Sequence[Sequence[int]],
        walls: Sequence[Sequence[float]],
    ) -> '_Scene':
        """A scene of bodies that these joints move, without pairs that no joint brings nearer, such
        as a base that stands on the floor.
        """
        kernels = _kernels()
        joints = [
            (each.before, each.axis, each.is_prismatic, each.parent) for each in kinematics.joints
        ]
        every = cls(
            np.array(joints, kernels.JOINT),
            np.array([*zip(moved_by, ends, radius, strict=True)], kernels.BODY),
            np.array(pairs, np.int64).reshape(-1, 2),
            np.array(walls, np.float64).reshape(-1, 7),
        )
        changes = np.zeros(len(every.pairs), bool)
        for q in np.random.default_rng(0).uniform(-1.0, 1.0, (_POSTURES, kinematics.n)):
            _, _, who = kernels.approaches(q, np.inf, *every)
            changes[who] = True
        return every._replace(pairs=every.pairs[changes])


@dataclass(frozen=True, eq=False)
class DistanceLimit(BrakingLimit):
    """C dq <= (d - d_s) / t_d for all that is nearer than d_i, and d >= d_s while the joints brake.

    C dq is the speed at which a distance d becomes smaller. The nearer, the slower the approach; at
    d_s there is none, and below it they go apart. The second condition is that of the limit
    `position`, for distances in place of joint positions: the arm can always stop in time, unless
    obstacles move, limits are tightened, commands get lost, or the limit `jerk` makes braking take
    longer. `scale` acts on the speed and on the accelerations.

    Where no acceleration limit is in force, this limit keeps the accelerations itself while
    anything is near, as well as the distances allow: joints that jump would swing between two ways.
    """

    order = 0
    still_brakes = True

    acceleration_is_limited: bool = False  # whether an acceleration limit is in force
    clearance: float = param(
        0.02, 'least distance from obstacles and walls [m]', 0.0, 1.0, live=True
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        # Read the URDF, and load compiled functions: now, and not in the loop.
        zeros = np.zeros(self.model.n)
        self.rows(ReferenceState(self.model, zeros, zeros), 1.0)

    @property
    @abstractmethod
    def _scene(self) -> _Scene:
        """What may come near what; always the same."""

    @abstractmethod
    def _pair_name(self, one: int, other: int) -> str:
        """What two approach each other, such as 'link_5 to floor'."""

    @property
    def influence(self) -> Meters:
        """d_i."""
        return max(_INFLUENCE, 2.0 * self.clearance)

    def approaches(self, q: JointPositions, reach: Meters) -> _Near:
        """The pairs nearer than `reach`: C with the speed of approach C dq, distances, indices."""
        return _kernels().approaches(q, reach, *self._scene)

    def rows(self, state: ReferenceState, T: Seconds) -> Rows:
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

    def name(self, row: int, state: ReferenceState, T: Seconds) -> str:
        _, _, who = _rows_at(self, state, T)
        if row >= len(who):
            return super().name(row - len(who), state, T)
        return self._pair_name(*self._scene.pairs[who[row]].tolist())

    def can_be_kept(self, dq: JointVelocities, state: ReferenceState, T: Seconds) -> bool:
        """Whether no pair comes nearer than d_s, or than by braking at once, if the joints brake
        after this tick. The rows are of first order, and of some places on the path; this is exact.
        """
        least, _ = self._least(state, dq, T, 1, self.clearance)
        if not least.min(initial=np.inf) < self.clearance:
            return True
        braking = self._braked(state, T, np.inf)
        least_braking, _ = self._least(state, braking.v, T, 1, self.clearance)
        return bool((least >= np.minimum(least_braking, self.clearance)).all())

    def _clearance_rows(self, state: ReferenceState, T: Seconds) -> _ClearanceRows:
        """Rows C dq <= high (r,) for which the arm keeps its clearance, and the pair of each (r,).

        Those that the acceleration limits imply are left out. There are two kinds, with d the
        distance of a pair and d_s the clearance. Of pairs nearer than the influence, the velocity
        damper C dq <= rate (d - d_s), with C at q, as the task's J: else the largest s would swing
        joints in every tick for a little of C dq. And d >= d_s while the joints brake by A from the
        next tick on: after this tick, where they come to rest, and where pairs are nearest between.
        They come to rest one after the other, so that an arm may pass a wall and turn back. To
        first order in dq, about the velocity v of braking already in this tick,

            C S (dq - v) <= d(q + s(v)) - d_s - b,

        with s(v) the path to such a place and S = ds/dv. The margin b = 1/2 lever |T S A|^2 is of
        second order: how far the arm leaves its tangent. Braking, dq = v, does not change the path,
        so these rows can be kept for ever, however many pairs there are.
        """
        gap = state.tick.gap
        levers = self.model.kinematics.max_point_jacobian  # (n,) [m]
        # How far any point may move, at most, if the joints brake after this tick.
        paths = (np.abs(state.dq_prev) + 2.0 * self.A * T) ** 2 / (2.0 * self.A)
        farthest = gap * float(levers.dot(paths))
        C, distance, who = self.approaches(state.q, self.influence + farthest)
        rate = self.scale / _TIME
        apart = distance - self.clearance
        high = rate * np.maximum(apart - _FREE, np.minimum(apart, 0.0))
        fastest = C.dot(state.dq_prev) + np.abs(C).dot(2.0 * T * self.A)
        is_damped = (distance < self.influence) & (fastest > high)
        found = [(C[is_damped], high[is_damped], who[is_damped])]
        if distance.min(initial=np.inf) <= self.clearance + farthest:
            now = np.full(len(self._scene.pairs), np.inf)
            now[who] = distance
            tick = (now, self.A, T, gap, rate, self.clearance, float(levers.max()))
            for v, slope, ticks, near in self._nearest_places(state, T):
                found.append(_kernels().braking_rows(*near, v, slope, ticks, *tick))
        rows, highs, pairs = zip(*found, strict=True)
        return np.concatenate(rows), np.concatenate(highs), np.concatenate(pairs)

    def _nearest_places(self, state: ReferenceState, T: Seconds) -> Iterator[_Place]:
        """Where joints rest if they brake after this tick, and where pairs are nearest before."""
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
            if least[pair] > near or len(taken) == _MOST_PLACES:
                return
            if min(abs(ticks[pair] - each) for each in taken) > step:
                taken.append(ticks[pair])
                yield self._braked(state, T, ticks[pair])

    def _change(self, slope: np.ndarray, state: ReferenceState, T: Seconds) -> Meters:
        """The most by which this tick changes a distance at a place of this slope (n,) [s]."""
        steps = (slope + state.tick.gap * T) * self.A * T
        return 2.0 * float(self.model.kinematics.max_point_jacobian.dot(steps))

    def _least(
        self, state: ReferenceState, dq: JointVelocities, T: Seconds, step: int, enough: Meters
    ) -> tuple[np.ndarray, np.ndarray]:
        """The least distance of each pair (P,) [m] on the path of joints that move by dq and then
        brake, and after how many ticks, (P,); looked at every `step` ticks, and exact below
        `enough`.
        """
        levers = self.model.kinematics.max_point_jacobian
        path = (state.q, dq, self.A, T, state.tick.gap, levers)
        least, ticks = _kernels().least_on_path(*path, step, enough, *self._scene)
        return least, ticks

    def _braked(self, state: ReferenceState, T: Seconds, ticks: float) -> _Place:
        """Where the arm is that has braked for so many ticks, with this one; infinity: at rest.

        A joint goes on by v, v - A T, v - 2 A T, ..., until less than A T is left.
        """
        gap = state.tick.gap
        speed = np.maximum(np.abs(state.dq_prev) - self.A * T, 0.0)
        longest = np.floor(speed / (self.A * T)) + 1.0
        k = np.minimum(ticks, longest)
        path = gap * T * (k * speed - self.A * T * k * (k - 1.0) / 2.0)
        sides = np.sign(state.dq_prev)
        slope = gap * np.minimum(ticks * T, speed / self.A + T)
        near = self.approaches(
            state.q + sides * path, self.clearance + self._change(slope, state, T)
        )
        return _Place(sides * speed, slope, min(ticks, float(longest.max())), near)


@dataclass(frozen=True, eq=False)
class CollisionLimit(DistanceLimit):
    """n' (J_a - J_b) dq <= (d - d_s) / t_d for each pair of bodies nearer than d_i, and d >= d_s
    while the joints brake.

    d is their distance, n the direction from the nearest point of a to that of b, J_a and J_b the
    Jacobians of these points. Bodies are capsules around links. Raises ArrayError for several tips.
    """

    obstacles: str = param(
        '',
        'what bodies keep off, such as "floor -0.1; sphere 0.5 0 0.4 0.1": z; x y z radius [m]',
        live=True,
    )

    def __post_init__(self) -> None:
        if self.model.arm.other_tips:
            raise ArrayError(
                f'the limit collision knows arms with one tip; {self.model.arm.source} has also '
                f'{", ".join(self.model.arm.other_tips)}'
            )
        super().__post_init__()

    @cached_property
    def _scene(self) -> _Scene:
        """The bodies, and spheres that no joint moves after them; floors are walls."""
        shapes = read_shapes(self.obstacles, OBSTACLES)
        floors = [shape.numbers[0] for shape in shapes if shape.kind == 'floor']
        spheres = np.array([shape.numbers for shape in shapes if shape.kind == 'sphere'])
        spheres = spheres.reshape(-1, 4)
        bodies = self.model.bodies
        number = len(bodies.links)
        pairs = bodies.pairs(self.influence).tolist()
        for body in range(number):
            pairs.extend([body, -1 - floor] for floor in range(len(floors)))
            pairs.extend([body, number + sphere] for sphere in range(len(spheres)))
        kernels = _kernels()
        return _Scene.made(
            self.model.kinematics,
            [*(bodies.moved_by - 1), *[kernels.BASE] * len(spheres)],
            np.concatenate((bodies.ends, np.repeat(spheres[:, None, :3], 2, axis=1))),
            np.concatenate((bodies.radius, spheres[:, 3])),
            pairs,
            [(kernels.HALF_SPACE, 0.0, 0.0, -1.0, -z, 0.0, 0.0) for z in floors],
        )

    def _pair_name(self, one: int, other: int) -> str:
        links = self.model.bodies.links
        names = (*links, *(f'sphere {k + 1}' for k in range(other)))
        return f'{links[one]} to {names[other] if other >= 0 else "floor"}'


@dataclass(frozen=True, eq=False)
class WorkspaceLimit(DistanceLimit):
    """n' J dq <= (d - d_s) / t_d for each point and each wall nearer than d_i, and d >= d_s while
    the joints brake.

    d is the distance of a point from the wall, n the direction towards it, J the point's Jacobian.
    Each wall applies to all points. Raises UnknownNameError for a point that is no link of the arm,
    and FileError for the elbow of an arm that has none.
    """

    walls: str = param(
        '',
        'what points keep to: half_space a b c d (a x + b y + c z <= d); inside_box or outside_box '
        'with least and largest x y z; inside_sphere or outside_sphere x y z radius [m]',
        live=True,
    )
    points: str = param(
        'tip',
        'points that keep to the walls: tip, elbow or names of links, separated by commas',
        live=True,
    )

    @cached_property
    def _scene(self) -> _Scene:
        """The points, each of which may come near each wall."""
        kinematics = self.model.kinematics
        placed = [kinematics.links[frame] for frame in self._frames]
        points = np.array([pose[:3, 3] for _, pose in placed])
        walls = [row for _, row in self._walls]
        return _Scene.made(
            kinematics,
            [joint for joint, _ in placed],
            np.repeat(points[:, None], 2, axis=1),
            np.zeros(len(points)),
            [(i, -1 - w) for i in range(len(points)) for w in range(len(walls))],
            walls,
        )

    def _pair_name(self, one: int, other: int) -> str:
        name, _ = self._walls[-1 - other]
        return f'{self._frames[one]} to {name}'

    @cached_property
    def _frames(self) -> tuple[str, ...]:
        """The links whose origins are the points."""
        known = {'tip': self.model.arm.tip_frame}
        names = [name.strip() for name in self.points.split(',')]
        if 'elbow' in names:
            known['elbow'] = self.model.elbow_frame
        frames = tuple(known.get(name, name) for name in names)
        for frame in frames:
            if frame not in self.model.kinematics.links:
                raise UnknownNameError('frame', frame, self.model.links)
        return frames

    @cached_property
    def _walls(self) -> list[tuple[str, list[float]]]:
        """All walls: their names, and the rows that kernels/distances.py describes."""
        walls: list[tuple[str, list[float]]] = []
        for k, shape in enumerate(read_shapes(self.walls, WALLS)):
            rows = _rows_of(shape)
            name = f'{shape.kind.replace("_", " ")} {k + 1}'
            names = [f'{face} of {name}' for face in _FACES] if len(rows) > 1 else [name]
            walls.extend(zip(names, rows, strict=True))
        return walls


def _rows_of(shape: Shape) -> list[list[float]]:
    """The rows of walls for a shape; the faces of a box to stay in are half-spaces."""
    kernels = _kernels()
    numbers = np.array(shape.numbers)
    if shape.kind == 'half_space':
        length = np.linalg.norm(numbers[:3])
        return [[kernels.HALF_SPACE, *(numbers / length), 0.0, 0.0]]
    if shape.kind == 'outside_box':
        return [[kernels.BOX, *numbers]]
    if shape.kind == 'inside_box':
        outwards = np.concatenate((-np.eye(3), np.eye(3)))
        ends = (*-numbers[:3], *numbers[3:])
        return [
            [kernels.HALF_SPACE, *normal, end, 0.0, 0.0]
            for normal, end in zip(outwards, ends, strict=True)
        ]
    side = 1.0 if shape.kind == 'inside_sphere' else -1.0
    return [[kernels.SPHERE, *numbers, side, 0.0]]


@lru_cache(maxsize=1)  # the name of a row is asked for right after the rows
def _rows_at(limit: DistanceLimit, state: ReferenceState, T: Seconds) -> _ClearanceRows:
    return limit._clearance_rows(state, T)


def _kernels() -> ModuleType:
    """The compiled kernels. They are loaded only if such a limit is used."""
    from redres_ros.kernels import distances

    return distances
