"""Defaults for an arm of which only the URDF is known: its limits, start, elbow and task."""

import math
from collections.abc import Iterator
from itertools import combinations, pairwise, product
from typing import NamedTuple

import numpy as np

from redres_ros.interpolation import PEAK_ACCELERATION, PEAK_SPEED
from redres_ros.robots.kinematics import Kinematics

_REVOLUTE_ACCELERATION = 10.0  # [rad/s^2]
_PRISMATIC_ACCELERATION = 5.0  # [m/s^2]

_BENT_JOINTS = 3  # at most, of a start
_POSTURES = 5_000  # at most, that are looked at for one
_BEND = 1.0  # [rad] or [m], from the middle of such a joint's range; at most half-way to its end
_GOOD_ENOUGH = 0.4  # of the best conditioning found

_LARGEST = 0.1  # [m]
_SMALLEST = 0.002  # [m]

_PLANES = ((1, 2), (0, 2), (0, 1))  # before the arm, beside it, lying: axes of the two sides
_SIDE_STEPS = 5  # of each side, in which the path of the joints is found
_PRECISION = 1e-5  # [m], to which the tip has to get to the end of each step
_FREE = 0.02  # of each joint's range that stays free at both ends
_USED = 0.3  # of the limits on velocity and acceleration that the joints may use
_SHORTEST = 1.0  # [s], of a side
_LONGEST = 6.0  # [s]; an arm with a slow joint, as a lift, gets a smaller square


def default_acceleration(kinematics: Kinematics) -> tuple[float, ...]:
    """Acceleration limits that most arms can follow, (n,) [rad/s^2] or [m/s^2]: an assumption."""
    return tuple(
        _PRISMATIC_ACCELERATION if joint.is_prismatic else _REVOLUTE_ACCELERATION
        for joint in kinematics.joints
    )


def default_start(kinematics: Kinematics) -> np.ndarray:
    """A posture to begin with, (n,) [rad] or [m]: the middle of the ranges, if that will do.

    There many an arm is stretched out, which is a singularity. Then as few joints as possible are
    bent, up to three, to make the posture about as well conditioned as the best one of this kind.
    Of equally good ones, it is the one with the tip farthest in front and above (x + z).
    """
    middle = (kinematics.lower + kinematics.upper) / 2.0
    bend = np.minimum((kinematics.upper - kinematics.lower) / 4.0, _BEND)
    bends = np.array(list(_bends(kinematics.n)))  # (N, n), of -1, 0 and 1
    postures = middle + bends * bend
    conditioning = _conditioning(kinematics, postures)
    good = conditioning >= _GOOD_ENOUGH * conditioning.max()
    bent_joints = np.count_nonzero(bends, axis=1)
    fewest = bent_joints == bent_joints[good].min()
    best = fewest & (conditioning > 0.99 * conditioning[fewest].max())
    tips = np.array([kinematics.position(q) for q in postures])  # (N, 3) [m]
    return postures[np.argmax(np.where(best, tips[:, 0] + tips[:, 2], -np.inf))]


def _bends(n: int) -> Iterator[np.ndarray]:
    """All combinations of up to three of n joints, bent to either side."""
    seen = 0
    for count in range(min(n, _BENT_JOINTS) + 1):
        seen += math.comb(n, count) * 2**count
        if seen > _POSTURES:
            return  # an arm of so many joints is well conditioned with fewer of them bent
        for joints in combinations(range(n), count):
            for sides in product((-1.0, 1.0), repeat=count):
                bends = np.zeros(n)
                bends[list(joints)] = sides
                yield bends


def _conditioning(kinematics: Kinematics, postures: np.ndarray) -> np.ndarray:
    """Smallest singular value of the Jacobian over the largest, of postures (N, n), (N,).

    Of the pose if there are enough joints for it, else of the position. Directions in which the
    arm cannot move at all, as out of its plane, do not count.
    """
    jacobians = np.array([kinematics.jacobian(q) for q in postures])  # (N, 6, n)
    jacobians[:, :3] /= np.linalg.norm(kinematics.offsets, axis=1).sum()  # no units
    rows = 6 if kinematics.n >= 6 else 3
    values = np.linalg.svd(jacobians[:, :rows], compute_uv=False)  # (N, k), descending
    largest = values[:, 0].max()
    rank = np.count_nonzero(values.max(axis=0) > 1e-6 * largest)
    return values[:, rank - 1] / largest


def default_elbow(kinematics: Kinematics) -> str:
    """The link whose origin counts as the elbow: that of the joint nearest to the arm's middle.

    The middle is halfway along the links from the first joint to the tip.
    """
    along = np.cumsum(np.linalg.norm(kinematics.offsets, axis=1))  # (n,) [m], the tip last
    from_middle = np.abs(np.concatenate(([0.0], along[:-1])) - along[-1] / 2.0)
    return kinematics.joints[kinematics.leading[int(np.argmin(from_middle))]].link


class SquareTask(NamedTuple):
    """Five points of the tip (5, 3) [m], from a corner round to it again, and the time a side [s].

    The time is long enough for every joint to stay far below its limits.
    """

    waypoints: np.ndarray
    segment_time: float


def square_before_tip(
    kinematics: Kinematics, start: np.ndarray, acceleration: np.ndarray
) -> SquareTask | None:
    """A feasible square from the initial position of the tip.

    It stands before the arm if that can be: its sides are along y and z. Else they are along x and
    z, or x and y. It reaches from the tip towards the base, if that can be. The sides are a tenth
    of a metre, or half of that as often as needed: to be within reach, and gone in a few seconds.

    Args:
        kinematics: Kinematics of the arm.
        start: Joint positions (n,) [rad] or [m].
        acceleration: Limits of the joints (n,) [rad/s^2] or [m/s^2].

    Returns:
        The square; None if no square is feasible.
    """
    slow: list[SquareTask] = []
    side = _LARGEST
    while side >= _SMALLEST:
        square = _square(kinematics, start, acceleration, side)
        if square and square.segment_time <= _LONGEST:
            return square
        if square:
            slow.append(square)
        side /= 2.0
    return slow[0] if slow else None


def _square(
    kinematics: Kinematics, start: np.ndarray, acceleration: np.ndarray, side: float
) -> SquareTask | None:
    """The first feasible square of that side [m]."""
    base = kinematics.joints[0].before[:3, 3]
    x = kinematics.position(start)
    inward = np.where(x > base + 1e-6, -1.0, 1.0)  # stretched out, an arm cannot go outward
    for axes in _PLANES:
        for signs in product((1.0, -1.0), repeat=2):
            waypoints = _corners(x, axes, side * inward[list(axes)] * signs)
            path = _joint_path(kinematics, start, waypoints)
            if path is not None:
                return SquareTask(waypoints, _segment_time(kinematics, path, acceleration))
    return None


def _corners(x: np.ndarray, axes: tuple[int, int], sides: np.ndarray) -> np.ndarray:
    """x, then one side, the other, back along the first, and back to x, (5, 3) [m]."""
    first = sides[0] * np.eye(3)[axes[0]]
    second = sides[1] * np.eye(3)[axes[1]]
    return np.array((x, x + first, x + first + second, x + second, x))


def _joint_path(
    kinematics: Kinematics, start: np.ndarray, waypoints: np.ndarray
) -> np.ndarray | None:
    """Joint positions (N, n) with the tip on the path at each step; None if it is not feasible."""
    margin = _FREE * (kinematics.upper - kinematics.lower)
    path = [start]
    for begin, end in pairwise(waypoints):
        for fraction in np.linspace(0.0, 1.0, _SIDE_STEPS + 1)[1:]:
            q = _nearest(kinematics, path[-1], begin + fraction * (end - begin))
            if q is None:
                return None
            if (q < kinematics.lower + margin).any() or (q > kinematics.upper - margin).any():
                return None
            path.append(q)
    return np.array(path)


def _nearest(kinematics: Kinematics, q: np.ndarray, x: np.ndarray) -> np.ndarray | None:
    """Joint positions near q (n,) with the tip at x (3,), by Newton's method; None if it fails."""
    for _ in range(5):
        error = x - kinematics.position(q)
        if np.linalg.norm(error) < _PRECISION:
            return q
        J = kinematics.jacobian(q)[:3]
        q = q + np.linalg.lstsq(J, error, rcond=1e-2)[0]  # without nearly singular directions
    return None


def _segment_time(kinematics: Kinematics, path: np.ndarray, acceleration: np.ndarray) -> float:
    """Time a side [s], to a tenth, from how far each joint goes for a side at its fastest."""
    rates = np.abs(np.diff(path, axis=0)).max(axis=0) * _SIDE_STEPS  # (n,) [rad] or [m] a side
    by_velocity = PEAK_SPEED * rates / (_USED * kinematics.velocity)
    by_acceleration = np.sqrt(PEAK_ACCELERATION * rates / (_USED * acceleration))
    longest = max(_SHORTEST, float(by_velocity.max()), float(by_acceleration.max()))
    return float(np.ceil(10.0 * longest) / 10.0)
