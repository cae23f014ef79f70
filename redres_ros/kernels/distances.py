"""Distances of bodies, and how joint velocities change them: the compiled ground of collision.py.

A body is a capsule: all points within a radius of a line segment. Its distance to another one is
that of their segments, less the radii; the closest points are where the segments are nearest.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import boolean, float64, int64, types

from redres_ros.kernels.compiled import compiled, inlined, part, several, vector

FLOOR = -1  # in place of a second body
FIRST_SPHERE = -2  # the second one is -3

# Of a row for where the arm comes to rest beside a velocity damper, where not all can be kept: what
# cannot be braked any more comes first.
WEIGHT = 100.0

_NOTHING = 1e-12  # [m^2] of a length squared, and of a row that no joint has a part in


class Chain(NamedTuple):
    """The joints of a serial arm, as they are in the URDF."""

    before: np.ndarray  # (n, 4, 4) from the frame that the joint before moves to this joint's
    axes: np.ndarray  # (n, 3) unit vectors in the joint's frame
    is_prismatic: np.ndarray  # (n,) of bool


class Shapes(NamedTuple):
    """The bodies of the arm, and what they may collide with."""

    moved_by: np.ndarray  # (B,) how many joints move each body
    ends: np.ndarray  # (B, 2, 3) of the bodies' axes, in the frame that its last joint moves [m]
    radius: np.ndarray  # (B,) [m]
    pairs: np.ndarray  # (P, 2) bodies that may collide with each other
    spheres: np.ndarray  # (S, 4) centres and radii of obstacles [m]
    floor: float  # its height [m]
    lever: float  # of any joint at most [m]


class Scene(NamedTuple):
    """Where joints and bodies are at one configuration, and which bodies are near."""

    origins: np.ndarray  # (n, 3) of the joints [m]
    axes: np.ndarray  # (n, 3) of the joints
    is_prismatic: np.ndarray  # (n,)
    points: np.ndarray  # (B, 2, 3) ends of the bodies' axes [m]
    radius: np.ndarray  # (B,) [m]
    moved_by: np.ndarray  # (B,) the number of joints that move a body
    reach: float  # [m], what is farther away does not matter
    C: np.ndarray  # (r, n) C dq is the speed of approach [m/s]
    distance: np.ndarray  # (r,) [m]
    who: np.ndarray  # (r, 2) approaches whom
    found: np.ndarray  # (1,) how many rows count


@inlined
def dot(a: np.ndarray, b: np.ndarray) -> float:
    """a' b."""
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@part
def within_one(share: float) -> float:
    """A share of a segment, clipped to it."""
    return min(max(share, 0.0), 1.0)


@part
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


@part
def add_motion(
    scene: Scene, row: np.ndarray, normal: np.ndarray, p: np.ndarray, joints: int
) -> None:
    """Add to row (n,) how fast the first `joints` joints move p (3,) along a normal, row dq.

    A joint with the axis z through o moves p by z x (p - o), a prismatic one by z.
    """
    for k in range(joints):
        z = scene.axes[k]
        if scene.is_prismatic[k]:
            row[k] += dot(normal, z)
            continue
        arm = p - scene.origins[k]
        row[k] += z[0] * (arm[1] * normal[2] - arm[2] * normal[1])
        row[k] += z[1] * (arm[2] * normal[0] - arm[0] * normal[2])
        row[k] += z[2] * (arm[0] * normal[1] - arm[1] * normal[0])


@part
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


@part
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
        row = np.zeros(len(scene.axes))
        normal = (p_j - p_i) / length
        add_motion(scene, row, normal, p_i, scene.moved_by[i])
        add_motion(scene, row, -normal, p_j, scene.moved_by[j])
        enter(scene, i, j, row, distance)


@part
def look_at_floor(scene: Scene, i: int, floor: float) -> None:
    """A body, and all that is below a height [m]."""
    lower = 0 if scene.points[i, 0, 2] < scene.points[i, 1, 2] else 1
    p = scene.points[i, lower]
    distance = p[2] - scene.radius[i] - floor
    if distance < scene.reach:
        row = np.zeros(len(scene.axes))
        add_motion(scene, row, np.array((0.0, 0.0, -1.0)), p, scene.moved_by[i])
        enter(scene, i, FLOOR, row, distance)


@part
def look_at_sphere(scene: Scene, i: int, name: int, ball: np.ndarray) -> None:
    """A body, and a ball (4,) with its centre and its radius [m]; a radius of 0 is none."""
    a = scene.points[i, 0]
    u = scene.points[i, 1] - a
    s, _ = nearest_shares(a, u, ball[:3], np.zeros(3))
    p = a + s * u
    length = np.sqrt(dot(ball[:3] - p, ball[:3] - p))
    distance = length - scene.radius[i] - ball[3]
    if ball[3] > 0.0 and distance < scene.reach and length**2 > _NOTHING:
        row = np.zeros(len(scene.axes))
        add_motion(scene, row, (ball[:3] - p) / length, p, scene.moved_by[i])
        enter(scene, i, name, row, distance)


@part
def turned(R: np.ndarray, axis: np.ndarray, angle: float) -> np.ndarray:
    """R (3, 3) times the rotation about a unit vector (3,) by an angle [rad]: Rodrigues."""
    sine = np.sin(angle)
    cosine = np.cos(angle)
    product = np.empty((3, 3))
    for i in range(3):
        row = R[i]
        along = (1.0 - cosine) * dot(row, axis)
        product[i, 0] = cosine * row[0] + along * axis[0]
        product[i, 1] = cosine * row[1] + along * axis[1]
        product[i, 2] = cosine * row[2] + along * axis[2]
        product[i, 0] += sine * (row[1] * axis[2] - row[2] * axis[1])
        product[i, 1] += sine * (row[2] * axis[0] - row[0] * axis[2])
        product[i, 2] += sine * (row[0] * axis[1] - row[1] * axis[0])
    return product


@part
def look_around(q: np.ndarray, chain: Chain, shapes: Shapes, reach: float) -> Scene:
    """The scene at q (n,) [rad], with all that is nearer than `reach` [m]."""
    n = len(q)
    B = len(shapes.radius)
    most = len(shapes.pairs) + B * (1 + len(shapes.spheres))
    scene = Scene(
        np.empty((n, 3)),
        np.empty((n, 3)),
        chain.is_prismatic,
        np.empty((B, 2, 3)),
        shapes.radius,
        shapes.moved_by,
        reach,
        np.zeros((most, n)),
        np.zeros(most),
        np.zeros((most, 2), np.int64),
        np.zeros(1, np.int64),
    )
    R = np.eye(3)
    o = np.zeros(3)
    for joints in range(n + 1):  # the frame that so many joints move
        if joints > 0:
            k = joints - 1
            before = chain.before[k]
            moved = np.empty((3, 3))
            for i in range(3):
                o[i] += dot(R[i], before[:3, 3])
                for j in range(3):
                    moved[i, j] = dot(R[i], before[:3, j])
            for i in range(3):
                scene.axes[k, i] = dot(moved[i], chain.axes[k])
                scene.origins[k, i] = o[i]
            if chain.is_prismatic[k]:
                o += q[k] * scene.axes[k]
                R = moved
            else:
                R = turned(moved, chain.axes[k], q[k])
        for i in range(B):
            if shapes.moved_by[i] == joints:
                for end in range(2):
                    for c in range(3):
                        scene.points[i, end, c] = o[c] + dot(R[c], shapes.ends[i, end])
    for k in range(len(shapes.pairs)):
        look_at_body(scene, shapes.pairs[k, 0], shapes.pairs[k, 1])
    for i in range(B):
        look_at_floor(scene, i, shapes.floor)
        for k in range(len(shapes.spheres)):
            look_at_sphere(scene, i, FIRST_SPHERE - k, shapes.spheres[k])
    return scene


_POINTS = float64[:, :, ::1]
_CHAIN: Any = types.NamedTuple(  # type: ignore[no-untyped-call]
    (_POINTS, float64[:, ::1], boolean[::1]), Chain
)
_SHAPES: Any = types.NamedTuple(  # type: ignore[no-untyped-call]
    (int64[::1], _POINTS, float64[::1], int64[:, ::1], float64[:, ::1], float64, float64), Shapes
)
_ROWS = several(float64[:, ::1], float64[::1], int64[:, ::1])


@compiled(_ROWS(vector(), _CHAIN, _SHAPES, float64))
def approaches(
    q: np.ndarray, chain: Chain, shapes: Shapes, reach: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """All that is nearer to the arm than `reach`, itself included.

    Args:
        q: Joint positions, (n,) [rad].
        chain: The joints.
        shapes: The bodies and the obstacles.
        reach: [m].

    Returns:
        Rows C (r, n), so that C dq is the speed of approach [m/s]; the distances (r,) [m]; and who
        approaches whom, (r, 2), with FLOOR, FIRST_SPHERE and so on for the second one.
    """
    scene = look_around(q, chain, shapes, reach)
    found = scene.found[0]
    return scene.C[:found], scene.distance[:found], scene.who[:found]


@part
def is_inside(scene: Scene, pair: np.ndarray, clearance: float) -> bool:
    """Whether a pair is nearer than the clearance [m] already."""
    for r in range(scene.found[0]):
        who = scene.who[r]
        if who[0] == pair[0] and who[1] == pair[1]:
            return scene.distance[r] < clearance
    return False


@compiled(
    _ROWS(
        *(vector(), vector(), vector(), float64, int64, _CHAIN, _SHAPES),
        *(float64, float64, float64),
    )
)
def collision_rows(
    q: np.ndarray,
    dq_prev: np.ndarray,
    A: np.ndarray,
    T: float,
    gap: int,
    chain: Chain,
    shapes: Shapes,
    influence: float,
    clearance: float,
    rate: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows C dq <= high for which the arm keeps its clearance.

    Those that the acceleration limits imply are left out. There are two kinds, with d the distance
    of a pair and d_s the clearance. At q, of pairs nearer than the influence, the velocity damper
    n' (J_a - J_b) dq <= rate (d - d_s). And at q + s(dq), where the joints come to rest if they
    brake by A from the next tick on, d >= d_s. To first order in dq, about the velocity v of
    braking already in this tick,

        C S (dq - v) <= d(q + s(v)) - d_s,   s(v) = v |v| / (2 A) + v T / 2 (exact for v = j A T)

    with S = ds/dv. Braking, dq = v, changes nothing about where the joints come to rest, so it
    keeps all of these rows, if those of the tick before were kept. That is why they can be kept for
    ever, however many pairs there are.

    Args:
        q: Joint positions, (n,) [rad].
        dq_prev: Last command, (n,) [rad/s].
        A: Acceleration limits, (n,) [rad/s^2].
        T: Sampling time [s].
        gap: Cycles between two commands, at most: the joints come to rest after as many times s.
        chain: The joints.
        shapes: The bodies and the obstacles.
        influence: d_i [m].
        clearance: d_s [m].
        rate: 1 / t_d [1/s].

    Returns:
        C (r, n), high (r,), and who approaches whom, (r, 2), as of `approaches`.
    """
    n = len(q)
    v = np.empty(n)
    q_stop = np.empty(n)
    slope = np.empty(n)  # S [s]; dq - v is at most 2 A T, in the sense of v
    reach = clearance
    for k in range(n):
        speed = max(abs(dq_prev[k]) - A[k] * T, 0.0)
        v[k] = np.copysign(speed, dq_prev[k])
        q_stop[k] = q[k] + gap * v[k] * (speed / (2.0 * A[k]) + T / 2.0)
        slope[k] = gap * (speed / A[k] + T)
        reach += slope[k] * 2.0 * A[k] * T * shapes.lever
    now = look_around(q, chain, shapes, influence)
    then = look_around(q_stop, chain, shapes, reach)
    most = now.found[0] + then.found[0]
    C = np.empty((most, n))
    high = np.empty(most)
    who = np.empty((most, 2), np.int64)
    count = 0
    for r in range(now.found[0]):
        allowed = rate * (now.distance[r] - clearance)
        fastest = dot(now.C[r], dq_prev)  # [m/s] of approach in this tick
        for k in range(n):
            fastest += abs(now.C[r, k]) * 2.0 * A[k] * T
        if fastest > allowed:
            C[count] = now.C[r]
            high[count] = allowed
            who[count] = now.who[r]
            count += 1
    for r in range(then.found[0]):
        row = C[count]
        farthest = 0.0  # [m] by which the distance at rest may become less in this tick
        for k in range(n):
            # The chord of s that is on the safe side: it becomes steeper with the speed.
            towards = then.C[r, k] * v[k]
            chord = slope[k] + 0.5 * gap * T * np.sign(towards)
            row[k] = then.C[r, k] * chord
            farthest += abs(row[k]) * 2.0 * A[k] * T
        margin = then.distance[r] - clearance
        if margin < farthest:
            if margin < 0.0 and is_inside(now, then.who[r], clearance):
                margin *= min(rate * T, 1.0)  # out again as slowly as by the damper
            # Of the size of the other rows, times the weight.
            size = WEIGHT * np.sqrt(dot(then.C[r], then.C[r]) / dot(row, row))
            high[count] = size * (margin + dot(row, v))
            row *= size
            who[count] = then.who[r]
            count += 1
    return C[:count], high[:count], who[:count]
