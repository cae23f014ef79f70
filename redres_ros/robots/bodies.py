"""The bodies of an arm, as capsules, whose distances are cheap to compute in every tick."""

from typing import NamedTuple

import numpy as np

from redres_ros.robots.kinematics import Kinematics
from redres_ros.types import Meters

_SHORTEST = 0.02  # [m] between joints that gets a body


class Bodies(NamedTuple):
    """B capsules around the lines from joint to joint, from base to tip."""

    links: tuple[str, ...]  # the name of the link of each; that of the base is 'base'
    moved_by: np.ndarray  # how many joints move each, (B,) of int64
    ends: np.ndarray  # of each axis, in the frame that its last joint moves, (B, 2, 3) [m]
    radius: np.ndarray  # (B,) [m]

    @classmethod
    def along(cls, kinematics: Kinematics, radius: tuple[float, ...]) -> 'Bodies':
        """The bodies of an arm; radius of the base and of each link, (n + 1,) [m], 0 for one
        without a body.
        """
        base = kinematics.joints[0].before[:3, 3]
        offsets = (base, *kinematics.offsets)
        links = ('base', *(joint.link for joint in kinematics.joints))
        chosen = [
            index
            for index, offset in enumerate(offsets)
            if radius[index] > 0.0 and np.linalg.norm(offset) > _SHORTEST
        ]
        ends = [_axis(offsets[index], radius[index], index == kinematics.n) for index in chosen]
        return cls(
            tuple(links[index] for index in chosen),
            np.array(chosen, np.int64),
            np.array(ends).reshape(-1, 2, 3),
            np.array([radius[index] for index in chosen]),
        )

    def pairs(self, apart: Meters) -> np.ndarray:
        """The pairs of bodies that may collide, (P, 2) of int64.

        Bodies are a pair if the straight arm keeps their surfaces farther apart than `apart`.
        Others touch at a joint, or nearly.
        """
        length = np.linalg.norm(self.ends[:, 1] - self.ends[:, 0], axis=1)
        pairs = [
            (i, j)
            for j in range(len(length))
            for i in range(j)
            if length[i + 1 : j].sum() - self.radius[i] - self.radius[j] > apart
        ]
        return np.array(pairs, np.int64).reshape(-1, 2)


def _axis(offset: np.ndarray, radius: Meters, is_last: bool) -> tuple[np.ndarray, np.ndarray]:
    """The ends of a capsule's axis. The last cap ends at the tip, which may be in contact."""
    length = float(np.linalg.norm(offset))
    fraction = max(1.0 - radius / length, 0.0) if is_last else 1.0
    return np.zeros(3), fraction * offset
