"""Distances of points from walls, and how joint velocities change them, compiled."""

import numpy as np
from numba import float64, int64

from redres_ros.kernels.compiled import compiled, inlined, matrix, several, vector

_SHORTEST = 1e-12  # [m] of a vector that has a direction


@inlined
def _box_from(x: np.ndarray, lower: np.ndarray, upper: np.ndarray, approach: np.ndarray) -> float:
    """The distance of a point from a box [m], below zero inside.

    Args:
        x: (3,) [m].
        lower: (3,) [m].
        upper: (3,) [m].
        approach: (3,) receives the direction in which it becomes smaller.
    """
    square = 0.0
    for c in range(3):
        approach[c] = min(max(x[c], lower[c]), upper[c]) - x[c]
        square += approach[c] * approach[c]
    if square > 0.0:
        distance = np.sqrt(square)
        for c in range(3):
            approach[c] /= max(distance, _SHORTEST)
        return distance
    face = 0  # the nearest: three lower ones, three upper ones
    depth = np.inf
    for k in range(6):
        c = k % 3
        within = x[c] - lower[c] if k < 3 else upper[c] - x[c]
        if within < depth:
            depth = within
            face = k
    for c in range(3):
        approach[c] = 0.0
    approach[face % 3] = 1.0 if face < 3 else -1.0
    return -depth


@compiled(
    several(float64[:, ::1], float64[::1], int64[:, ::1])(
        *(matrix(), float64[:, :, ::1], matrix(), vector()),
        *(matrix(), matrix(), matrix(), vector(), vector(), float64),
    )
)
def approaches(
    x: np.ndarray,
    J: np.ndarray,
    normals: np.ndarray,
    offsets: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    centres: np.ndarray,
    radii: np.ndarray,
    sides: np.ndarray,
    reach: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """All walls that are nearer to a point than `reach`.

    Args:
        x: Points, (points, 3) [m].
        J: Of each, (points, 3, n).
        normals: Of half-spaces, (h, 3); they point outwards.
        offsets: n' x <= offset is allowed, (h,) [m].
        lower: Least x, y, z of boxes to stay out of, (b, 3) [m].
        upper: Largest, (b, 3) [m].
        centres: Of spheres, (s, 3) [m].
        radii: (s,) [m].
        sides: 1 for a sphere to stay in, -1 for one to stay out of, (s,).
        reach: [m].

    Returns:
        Rows C (r, n), so that C dq is the speed of approach [m/s]; the distances, positive on the
        allowed side, (r,) [m]; and the point and the wall, half-spaces first, then boxes, (r, 2).
    """
    n = J.shape[2]
    h = len(normals)
    b = len(lower)
    walls = h + b + len(centres)
    most = len(x) * walls
    C = np.zeros((most, n))
    distances = np.empty(most)
    found = np.empty((most, 2), np.int64)
    approach = np.empty(3)
    count = 0
    for point in range(len(x)):
        for wall in range(walls):
            distance = 0.0
            if wall < h:
                distance = offsets[wall]
                for c in range(3):
                    approach[c] = normals[wall, c]
                    distance -= normals[wall, c] * x[point, c]
            elif wall < h + b:
                distance = _box_from(x[point], lower[wall - h], upper[wall - h], approach)
            else:
                ball = wall - h - b
                square = 0.0
                for c in range(3):
                    approach[c] = x[point, c] - centres[ball, c]
                    square += approach[c] * approach[c]
                radius = np.sqrt(square)
                distance = sides[ball] * (radii[ball] - radius)
                for c in range(3):
                    approach[c] *= sides[ball] / max(radius, _SHORTEST)
            if not distance < reach:
                continue
            distances[count] = distance
            found[count, 0] = point
            found[count, 1] = wall
            for c in range(3):
                for k in range(n):
                    C[count, k] += approach[c] * J[point, c, k]
            count += 1
    return C[:count], distances[:count], found[:count]
