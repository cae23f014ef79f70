"""Distances of bodies, and how joint velocities change them: the compiled ground of collision.py.

A body is a capsule: all points within a radius of a line segment. Its distance to another one is
that of their segments, less the radii; the witness points are where the segments are nearest.
"""

from typing import NamedTuple

import numpy as np
from numba import float64, int64, types

from redres_ros.kernels.arithmetic import dot
from redres_ros.kernels.compiled import compiled, matrix, several, vector

FLOOR = -1  # in place of a second body
FIRST_SPHERE = -2  # the second one is -3

_NOTHING = 1e-12  # [m^2] of a length squared, and of a row that no joint has a part in


class Scene(NamedTuple):
    """Where the bodies are, how the joints move them, and what was found to be near."""

    points: np.ndarray  # (B, 2, 3) ends of the bodies' axes [m]
    radius: np.ndarray  # (B,) [m]
    moved_by: np.ndarray  # (B,) the number of joints that move a body
    J: np.ndarray  # (6, n) of the tip
    x: np.ndarray  # (3,) where that is [m]
    reach: float  # [m], what is farther away does not matter
    C: np.ndarray  # (r, n) C dq is the speed of approach [m/s]
    distance: np.ndarray  # (r,) [m]
    who: np.ndarray  # (r, 2) approaches whom
    found: np.ndarray  # (1,) how many rows count


@compiled()
def within_one(share: float) -> float:
    """A share of a segment, clipped to it."""
    return min(max(share, 0.0), 1.0)


@compiled()
def nearest_shares(
    a: np.ndarray, u: np.ndarray, b: np.ndarray, v: np.ndarray
) -> tuple[float, float]:
    """s and t in [0, 1] with the least |(a + s u) - (b + t v)|, each argument (3,) [m].

    First s of the nearest points of the two lines, clipped; then t, the best for it; then s, the
    best for that, in case t was clipped. Of parallel segments it is one pair of many.
    """
    way = b - a
    uu = dot(u, u)
    vv = dot(v, v)
    uv = dot(u, v)
    ahead = dot(u, way)
    back = dot(v, way)
    area = uu * vv - uv * uv
    s = within_one((ahead * vv - back * uv) / area) if area > _NOTHING * uu * vv else 0.0
    t = within_one((s * uv - back) / vv) if vv > _NOTHING else 0.0
    s = within_one((t * uv + ahead) / uu) if uu > _NOTHING else 0.0
    return s, t


@compiled()
def add_motion(
    scene: Scene, row: np.ndarray, normal: np.ndarray, p: np.ndarray, joints: int
) -> None:
    """Add to row (n,) how fast the joints move a point along a normal, row dq.

    The first `joints` joints move the point p (3,) as they would the tip, were it there:
    v = J_v dq + (J_w dq) x (p - x).
    """
    arm = p - scene.x
    turn = np.array(  # (p - x) x normal
        (
            arm[1] * normal[2] - arm[2] * normal[1],
            arm[2] * normal[0] - arm[0] * normal[2],
            arm[0] * normal[1] - arm[1] * normal[0],
        )
    )
    for k in range(joints):
        for c in range(3):
            row[k] += normal[c] * scene.J[c, k] + turn[c] * scene.J[3 + c, k]


@compiled()
def enter(scene: Scene, i: int, other: int, row: np.ndarray, distance: float) -> None:
    """Add what body i approaches, unless no joint can do anything about it."""
    if dot(row, row) > _NOTHING:
        at = scene.found[0]
        for k in range(len(row)):
            scene.C[at, k] = row[k]
        scene.distance[at] = distance
        scene.who[at, 0] = i
        scene.who[at, 1] = other
        scene.found[0] = at + 1


@compiled()
def look_at_body(scene: Scene, i: int, j: int) -> None:
    """Two bodies of the arm: n' (J_i - J_j), with n the way from the one to the other."""
    a = scene.points[i, 0]
    b = scene.points[j, 0]
    u = scene.points[i, 1] - a
    v = scene.points[j, 1] - b
    s, t = nearest_shares(a, u, b, v)
    p_i = a + s * u
    p_j = b + t * v
    length = np.sqrt(dot(p_j - p_i, p_j - p_i))
    distance = length - scene.radius[i] - scene.radius[j]
    if distance < scene.reach and length**2 > _NOTHING:
        row = np.zeros(scene.J.shape[1])
        normal = (p_j - p_i) / length
        add_motion(scene, row, normal, p_i, scene.moved_by[i])
        add_motion(scene, row, -normal, p_j, scene.moved_by[j])
        enter(scene, i, j, row, distance)


@compiled()
def look_at_floor(scene: Scene, i: int, floor: float) -> None:
    """A body, and all that is below a height [m]."""
    lower = 0 if scene.points[i, 0, 2] < scene.points[i, 1, 2] else 1
    p = scene.points[i, lower]
    distance = p[2] - scene.radius[i] - floor
    if distance < scene.reach:
        row = np.zeros(scene.J.shape[1])
        add_motion(scene, row, np.array((0.0, 0.0, -1.0)), p, scene.moved_by[i])
        enter(scene, i, FLOOR, row, distance)


@compiled()
def look_at_sphere(scene: Scene, i: int, name: int, ball: np.ndarray) -> None:
    """A body, and a ball (4,) with its centre and its radius [m]; a radius of 0 is none."""
    a = scene.points[i, 0]
    u = scene.points[i, 1] - a
    s, _ = nearest_shares(a, u, ball[:3], np.zeros(3))
    p = a + s * u
    length = np.sqrt(dot(ball[:3] - p, ball[:3] - p))
    distance = length - scene.radius[i] - ball[3]
    if ball[3] > 0.0 and distance < scene.reach and length**2 > _NOTHING:
        row = np.zeros(scene.J.shape[1])
        add_motion(scene, row, (ball[:3] - p) / length, p, scene.moved_by[i])
        enter(scene, i, name, row, distance)


@compiled()
def placed(poses: np.ndarray, moved_by: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """The ends of the bodies' axes in the base frame, (B, 2, 3) [m]."""
    points = np.empty(ends.shape)
    for i in range(len(ends)):
        H = poses[moved_by[i]]
        for end in range(2):
            for c in range(3):
                points[i, end, c] = H[c, 3] + dot(H[c, :3], ends[i, end])
    return points


def _cube() -> object:
    return types.Array(float64, 3, 'A', readonly=True)


@compiled(
    several(float64[:, ::1], float64[::1], int64[:, ::1])(
        *(_cube(), vector(int64), _cube(), vector(), matrix(int64)),
        *(float64, matrix(), matrix(), vector(), float64),
    )
)
def approaches(
    poses: np.ndarray,
    moved_by: np.ndarray,
    ends: np.ndarray,
    radius: np.ndarray,
    pairs: np.ndarray,
    floor: float,
    spheres: np.ndarray,
    J: np.ndarray,
    x: np.ndarray,
    reach: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """All that is nearer to the arm than `reach`, itself included.

    Args:
        poses: (n + 1, 4, 4) of the base and of the frame that each joint moves.
        moved_by: (B,) how many joints move each body.
        ends: (B, 2, 3) of the bodies' axes, in the frame that its last joint moves [m].
        radius: (B,) [m].
        pairs: (P, 2) bodies that may collide with each other.
        floor: Its height [m].
        spheres: (S, 4) centres and radii of obstacles [m].
        J: (6, n) Jacobian of the tip.
        x: (3,) where that is [m].
        reach: [m].

    Returns:
        Rows C (r, n), so that C dq is the speed of approach [m/s]; the distances (r,) [m]; and who
        approaches whom, (r, 2), with FLOOR, FIRST_BALL and so on for the second one.
    """
    most = len(pairs) + len(radius) * (1 + len(spheres))
    scene = Scene(
        placed(poses, moved_by, ends),
        radius,
        moved_by,
        J,
        x,
        reach,
        np.zeros((most, J.shape[1])),
        np.zeros(most),
        np.zeros((most, 2), np.int64),
        np.zeros(1, np.int64),
    )
    for k in range(len(pairs)):
        look_at_body(scene, pairs[k, 0], pairs[k, 1])
    for i in range(len(radius)):
        look_at_floor(scene, i, floor)
        for k in range(len(spheres)):
            look_at_sphere(scene, i, FIRST_SPHERE - k, spheres[k])
    found = scene.found[0]
    return scene.C[:found], scene.distance[:found], scene.who[:found]
