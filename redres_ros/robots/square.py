"""A small square in front of the tip: the default task of an arm known only by its URDF."""

from itertools import pairwise, product
from typing import NamedTuple

import numpy as np

from redres_ros.robots.kinematics import Kinematics

LARGEST_SIDE = 0.1  # [m]
SMALLEST_SIDE = 0.002  # [m]

_PLANES = ((1, 2), (0, 2), (0, 1))  # before the arm, beside it, lying: axes of the two sides
_STEPS = 5  # of each side, in which the path of the joints is found
_PRECISION = 1e-5  # [m], to which the tip has to get to the end of each step
_MARGIN = 0.02  # of each joint's range that stays free at both ends
_FRACTION = 0.3  # of the limits on velocity and acceleration that the joints may use
_SHORTEST = 1.0  # [s], of a side
_LONGEST = 6.0  # [s]; an arm with a slow joint, as a lift, gets a smaller square


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
        kinematics: Of the arm.
        start: Joint positions (n,) [rad] or [m].
        acceleration: Limits of the joints (n,) [rad/s^2] or [m/s^2].

    Returns:
        The square; None where the arm can go round none.
    """
    slow: list[SquareTask] = []
    side = LARGEST_SIDE
    while side >= SMALLEST_SIDE:
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
    """Joint positions (4 _STEPS + 1, n) with the tip on the path; None if it is not feasible."""
    margin = _MARGIN * (kinematics.upper - kinematics.lower)
    path = [start]
    for begin, end in pairwise(waypoints):
        for fraction in np.linspace(0.0, 1.0, _STEPS + 1)[1:]:
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
    rates = np.abs(np.diff(path, axis=0)).max(axis=0) * _STEPS  # (n,) [rad] or [m] a side
    by_velocity = 1.875 * rates / (_FRACTION * kinematics.velocity)  # 15/8: peak of ds, Eq. (36)
    by_acceleration = np.sqrt(5.774 * rates / (_FRACTION * acceleration))  # 10/sqrt(3): of dds
    longest = max(_SHORTEST, float(by_velocity.max()), float(by_acceleration.max()))
    return float(np.ceil(10.0 * longest) / 10.0)
