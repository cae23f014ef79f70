"""Distances of bodies, and how joint velocities change them, compiled.

A body is a capsule: all points within a radius of a line segment. Its distance to another one is
that of their segments, less the radii; the closest points are where the segments are nearest.

Everything is written in scalars: numba compiles one expression of arrays as long as a whole loop.
"""

import numpy as np
from numba import boolean, float64, int64

from redres_ros.kernels.compiled import compiled, part, several, vector

FLOOR = -1  # in place of a second body

_NOTHING = 1e-12  # [m^2] of a length squared, and of a row that no joint has a part in

_POINTS = float64[:, :, ::1]


@part
def _nearest_shares(
    uu: float, vv: float, uv: float, ahead: float, back: float
) -> tuple[float, float]:
    """s and t in [0, 1] with the least |(a + s u) - (b + t v)|, of two segments.

    First s of the nearest points of the two lines, clipped; then t, the best for it; then s, the
    best for that, in case t was clipped. Of parallel segments it is one pair of many.

    Args:
        uu: u' u [m^2].
        vv: v' v.
        uv: u' v.
        ahead: u' (b - a).
        back: v' (b - a).
    """
    s = 0.0
    t = 0.0
    area = uu * vv - uv * uv
    if area > _NOTHING * uu * vv:
        s = min(max((ahead * vv - back * uv) / area, 0.0), 1.0)
    if vv > _NOTHING:
        t = min(max((s * uv - back) / vv, 0.0), 1.0)
    if uu > _NOTHING:
        s = min(max((t * uv + ahead) / uu, 0.0), 1.0)
    return s, t


@part
def _nearest_points(points: np.ndarray, i: int, j: int, at: np.ndarray) -> None:
    """Write the point of segment i that is nearest to segment j into at[0], the other into at[1].

    Args:
        points: Ends of the segments, (B, 2, 3) [m].
        i: Number of one segment.
        j: Number of the other.
        at: (2, 3) receives the points [m].
    """
    uu = 0.0
    vv = 0.0
    uv = 0.0
    ahead = 0.0
    back = 0.0
    for c in range(3):
        u = points[i, 1, c] - points[i, 0, c]
        v = points[j, 1, c] - points[j, 0, c]
        between = points[j, 0, c] - points[i, 0, c]
        uu += u * u
        vv += v * v
        uv += u * v
        ahead += u * between
        back += v * between
    s, t = _nearest_shares(uu, vv, uv, ahead, back)
    for c in range(3):
        at[0, c] = points[i, 0, c] + s * (points[i, 1, c] - points[i, 0, c])
        at[1, c] = points[j, 0, c] + t * (points[j, 1, c] - points[j, 0, c])


@part
def turn(R: np.ndarray, axis: np.ndarray, angle: float) -> None:
    """R (3, 3) becomes R times the rotation about a unit vector (3,) by an angle [rad]: Rodrigues'
    formula, for each row.
    """
    sine = np.sin(angle)
    cosine = np.cos(angle)
    for i in range(3):
        x = R[i, 0]
        y = R[i, 1]
        z = R[i, 2]
        along = (1.0 - cosine) * (x * axis[0] + y * axis[1] + z * axis[2])
        R[i, 0] = cosine * x + along * axis[0] + sine * (y * axis[2] - z * axis[1])
        R[i, 1] = cosine * y + along * axis[1] + sine * (z * axis[0] - x * axis[2])
        R[i, 2] = cosine * z + along * axis[2] + sine * (x * axis[1] - y * axis[0])


@part
def place(
    q: np.ndarray,
    before: np.ndarray,
    axes: np.ndarray,
    is_prismatic: np.ndarray,
    moved_by: np.ndarray,
    ends: np.ndarray,
    lines: np.ndarray,
    points: np.ndarray,
) -> None:
    """Compute where joints and bodies are at q; the arguments are those of `approaches`.

    Args:
        q: (n,) [rad].
        before: (n, 4, 4).
        axes: (n, 3).
        is_prismatic: (n,).
        moved_by: (B,).
        ends: (B, 2, 3).
        lines: (n, 2, 3) receives each joint's origin [m] and its axis, in the base frame.
        points: (B, 2, 3) receives the ends of the bodies' axes, in the base frame [m].
    """
    n = len(q)
    H = np.zeros((3, 4))  # pose of the frame that the joints so far move
    moved = np.empty((3, 4))
    for i in range(3):
        H[i, i] = 1.0
    for joints in range(n + 1):
        if joints > 0:
            k = joints - 1
            for i in range(3):
                for j in range(4):
                    moved[i, j] = H[i, 3] if j == 3 else 0.0
                    for c in range(3):
                        moved[i, j] += H[i, c] * before[k, c, j]
            for i in range(3):
                lines[k, 0, i] = moved[i, 3]
                lines[k, 1, i] = 0.0
                for c in range(3):
                    lines[k, 1, i] += moved[i, c] * axes[k, c]
                for j in range(4):
                    H[i, j] = moved[i, j]
                if is_prismatic[k]:
                    H[i, 3] += q[k] * lines[k, 1, i]
            if not is_prismatic[k]:
                turn(H, axes[k], q[k])
        for i in range(len(ends)):
            if moved_by[i] == joints:
                for end in range(2):
                    for c in range(3):
                        points[i, end, c] = H[c, 3]
                        for j in range(3):
                            points[i, end, c] += H[c, j] * ends[i, end, j]


@part
def add_motion(
    row: np.ndarray,
    lines: np.ndarray,
    is_prismatic: np.ndarray,
    joints: int,
    normal: np.ndarray,
    p: np.ndarray,
    sign: float,
) -> None:
    """Add to row (n,) how fast the first joints move a point along a normal: row dq [m/s].

    A joint with the axis z through o moves p by z x (p - o), a prismatic one by z.

    Args:
        row: (n,).
        lines: (n, 2, 3) of the joints.
        is_prismatic: (n,).
        joints: How many joints move the point.
        normal: (3,).
        p: The point, (3,) [m].
        sign: 1, or -1 for what is subtracted.
    """
    for k in range(joints):
        for a in range(3):
            b = (a + 1) % 3
            c = (a + 2) % 3
            z = sign * lines[k, 1, a]
            if is_prismatic[k]:
                row[k] += z * normal[a]
            else:
                row[k] += z * (p[b] - lines[k, 0, b]) * normal[c]
                row[k] -= z * (p[c] - lines[k, 0, c]) * normal[b]


@compiled(
    several(float64[:, ::1], float64[::1], int64[:, ::1])(
        *(vector(), _POINTS, float64[:, ::1], boolean[::1]),
        *(int64[::1], _POINTS, float64[::1], int64[:, ::1], float64, float64),
    )
)
def approaches(
    q: np.ndarray,
    before: np.ndarray,
    axes: np.ndarray,
    is_prismatic: np.ndarray,
    moved_by: np.ndarray,
    ends: np.ndarray,
    radius: np.ndarray,
    pairs: np.ndarray,
    floor: float,
    reach: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """All that is nearer to the arm than `reach`, itself included: n' (J_i - J_j) of each pair.

    Args:
        q: Joint positions, (n,) [rad].
        before: (n, 4, 4) from the frame that the joint before moves to this joint's.
        axes: Of the joints, (n, 3) unit vectors in the joint's frame.
        is_prismatic: (n,).
        moved_by: How many joints move each body, (B,); 0 for one that stands still.
        ends: (B, 2, 3) of the bodies' axes, in the frame that its last joint moves [m].
        radius: Of the bodies, (B,) [m].
        pairs: Bodies that may collide with each other, (P, 2); the second one may be FLOOR.
        floor: All that is below this height [m].
        reach: [m].

    Returns:
        Rows C (r, n), so that C dq is the speed of approach [m/s]; the distances (r,) [m]; and
        which pair each belongs to, (r, 2).
    """
    n = len(q)
    lines = np.empty((n, 2, 3))
    points = np.empty((len(ends), 2, 3))
    place(q, before, axes, is_prismatic, moved_by, ends, lines, points)
    at = np.empty((2, 3))
    normal = np.empty(3)
    C = np.zeros((len(pairs), n))
    distance = np.empty(len(pairs))
    found = np.empty((len(pairs), 2), np.int64)
    count = 0
    for pair in range(len(pairs)):
        i = pairs[pair, 0]
        j = pairs[pair, 1]
        if j == FLOOR:
            lower = 0 if points[i, 0, 2] < points[i, 1, 2] else 1
            for c in range(3):
                at[0, c] = points[i, lower, c]
                normal[c] = 0.0
            normal[2] = -1.0
            distance[count] = at[0, 2] - radius[i] - floor
            joints = 0
        else:
            _nearest_points(points, i, j, at)
            square = 0.0
            for c in range(3):
                normal[c] = at[1, c] - at[0, c]
                square += normal[c] * normal[c]
            if not square > _NOTHING:
                continue
            length = np.sqrt(square)
            for c in range(3):
                normal[c] /= length
            distance[count] = length - radius[i] - radius[j]
            joints = moved_by[j]
        if not distance[count] < reach:
            continue
        row = C[count]
        for k in range(n):
            row[k] = 0.0
        add_motion(row, lines, is_prismatic, moved_by[i], normal, at[0], 1.0)
        add_motion(row, lines, is_prismatic, joints, normal, at[1], -1.0)
        square = 0.0
        for k in range(n):
            square += row[k] * row[k]
        if square > _NOTHING:  # else no joint can do anything about it
            found[count, 0] = i
            found[count, 1] = j
            count += 1
    return C[:count], distance[:count], found[:count]
