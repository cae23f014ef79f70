"""Defaults for an arm of which only the URDF is known."""

import math
from collections.abc import Iterator
from itertools import combinations, product

import numpy as np

from redres_ros.robots.kinematics import Kinematics

REVOLUTE_ACCELERATION = 10.0  # [rad/s^2]
PRISMATIC_ACCELERATION = 5.0  # [m/s^2]

_BENT_JOINTS = 3  # at most, of a start
_POSTURES = 5_000  # at most, that are looked at for one
_BEND = 1.0  # [rad] or [m], from the middle of such a joint's range; at most half-way to its end
_GOOD_ENOUGH = 0.4  # of the best conditioning found


def default_acceleration(kinematics: Kinematics) -> tuple[float, ...]:
    """Acceleration limits that most arms can follow, (n,) [rad/s^2] or [m/s^2]: an assumption."""
    return tuple(
        PRISMATIC_ACCELERATION if joint.is_prismatic else REVOLUTE_ACCELERATION
        for joint in kinematics.joints
    )


def default_start(kinematics: Kinematics) -> np.ndarray:
    """A posture to begin with, (n,) [rad] or [m]: the middle of the ranges, where that will do.

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
    chosen: np.ndarray = postures[np.argmax(np.where(best, tips[:, 0] + tips[:, 2], -np.inf))]
    return chosen


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
    """For each posture (N, n), the smallest singular value of the Jacobian over the largest, (N,).

    Of the pose where there are joints enough for it, else of the position. Directions in which the
    arm cannot move at all, as out of its plane, do not count.
    """
    jacobians = np.array([kinematics.jacobian(q) for q in postures])  # (N, 6, n)
    jacobians[:, :3] /= np.linalg.norm(kinematics.offsets, axis=1).sum()  # no units
    rows = 6 if kinematics.n >= 6 else 3
    values = np.linalg.svd(jacobians[:, :rows], compute_uv=False)  # (N, k), descending
    largest = values[:, 0].max()
    rank = np.count_nonzero(values.max(axis=0) > 1e-6 * largest)
    conditioning: np.ndarray = values[:, rank - 1] / largest
    return conditioning


def default_elbow(kinematics: Kinematics) -> str:
    """The link whose origin counts as the elbow: that of the joint nearest to the arm's middle.

    The middle is halfway along the links from the first joint to the tip.
    """
    along = np.cumsum(np.linalg.norm(kinematics.offsets, axis=1))  # (n,) [m], the tip last
    from_middle = np.abs(np.concatenate(([0.0], along[:-1])) - along[-1] / 2.0)
    return kinematics.joints[kinematics.leading[int(np.argmin(from_middle))]].link
