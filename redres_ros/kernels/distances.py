"""Distances of bodies and walls, how joint velocities change them, and the rows of the limits that
keep them, compiled: with numpy they take as long as a tick.

A body is a capsule: all points within a radius of a line segment. Its distance to another one is
that of their segments, less the radii; the closest points are where the segments are nearest. A
body that is to keep away from boxes and spheres of `walls` is a point: both ends are the same.

The scene that `approaches` and `least_on_path` take is four arrays. As one object they would take
half as long again: numba counts the references to each member wherever it is read.

    joints          (n,) of JOINT
    bodies          (B,) of BODY
    pairs           what may collide, (P, 2): a body, and another one, or -1 - w for wall w
    walls           (W, 7): a kind, and its numbers: n and d of a half-space n' x <= d; least and
                    largest x, y, z of a box to stay out of; centre, radius and side of a sphere,
                    1 to stay in, -1 to stay out

In the rows of limits `who` (r,) is the pair that each belongs to. `max_point_jacobian` (n,) is how
far a radian of each joint moves any point of the arm, at most [m].

Everything is written in scalars: numba compiles one expression of arrays as long as a whole loop.
"""

import numpy as np
from numba import float64, from_dtype, int64

from redres_ros.kernels.compiled import compiled, matrix, part, several, vector

BASE = -1  # in place of a joint's index

HALF_SPACE = 0.0  # the kinds of walls
BOX = 1.0
SPHERE = 2.0

_LONGEST = 1e5  # ticks in which joints brake,
_LOOKS = 500.0  # of which no more are looked at than about so many
_SHORTEST = 1e-12  # [m] of a vector that has a direction
_NOTHING = 1e-12  # [m^2] of a length squared, and of a row that no joint has a part in

# Of a row for the path of a braking arm, beside a velocity damper, where not all can be kept: what
# cannot be braked any more comes first.
_WEIGHT = 1000.0
_INSIDE = 1e-6  # [m] beyond its clearance a pair is too near by more than rounding

JOINT = np.dtype(
    [
        ('before', float, (4, 4)),  # from the frame that the joint's parent moves to the joint's
        ('axis', float, 3),  # unit vector in the joint's frame
        ('is_prismatic', bool),
        ('parent', np.int64),  # index of the joint before it; BASE: there is none
    ],
    align=True,
)
BODY = np.dtype(
    [
        ('moved_by', np.int64),  # the last joint that moves it; BASE for one that stands still
        ('ends', float, (2, 3)),  # of its axis, in the frame that this joint moves [m]
        ('radius', float),  # [m]
    ]
)

_ROWS = float64[:, ::1]
_VECTOR = float64[::1]
_INDICES = int64[::1]
_SCENE = from_dtype(JOINT)[::1], from_dtype(BODY)[::1], int64[:, ::1], _ROWS


@part
def _nearest_points(points: np.ndarray, i: int, j: int, at: np.ndarray) -> None:
    """Write the point of segment i that is nearest to segment j into at[0], the other into at[1],
    (2, 3) [m].

    First s of the nearest points of the two lines, clipped; then t, the best for it; then s, the
    best for that, in case t was clipped. Of parallel segments it is one pair of many.
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
    s = 0.0  # the nearest points are a + s u and b + t v
    t = 0.0
    area = uu * vv - uv * uv
    if area > _NOTHING * uu * vv:
        s = min(max((ahead * vv - back * uv) / area, 0.0), 1.0)
    if vv > _NOTHING:
        t = min(max((s * uv - back) / vv, 0.0), 1.0)
    if uu > _NOTHING:
        s = min(max((t * uv + ahead) / uu, 0.0), 1.0)
    for c in range(3):
        at[0, c] = points[i, 0, c] + s * (points[i, 1, c] - points[i, 0, c])
        at[1, c] = points[j, 0, c] + t * (points[j, 1, c] - points[j, 0, c])


@part
def _to_box(x: np.ndarray, wall: np.ndarray, normal: np.ndarray) -> float:
    """The distance of a point (3,) from a box [m], below zero inside; the direction in which it
    becomes smaller into `normal` (3,).
    """
    square = 0.0
    for c in range(3):
        normal[c] = min(max(x[c], wall[1 + c]), wall[4 + c]) - x[c]
        square += normal[c] * normal[c]
    if square > 0.0:
        distance = np.sqrt(square)
        for c in range(3):
            normal[c] /= max(distance, _SHORTEST)
        return float(distance)
    face = 0  # the nearest: three lower ones, three upper ones
    depth = np.inf
    for k in range(6):
        within = x[k % 3] - wall[1 + k] if k < 3 else wall[1 + k] - x[k % 3]
        if within < depth:
            depth = within
            face = k
    for c in range(3):
        normal[c] = 0.0
    normal[face % 3] = 1.0 if face < 3 else -1.0
    return -depth


@part
def _to_wall(
    points: np.ndarray, i: int, wall: np.ndarray, at: np.ndarray, normal: np.ndarray
) -> float:
    """The distance of a segment from a half-space, or of a point from any wall [m], positive on the
    allowed side; the nearest point into at[0], the way to less of it into `normal` (3,).
    """
    end = 0
    if wall[0] == HALF_SPACE:
        ahead = 0.0
        for c in range(3):
            normal[c] = wall[1 + c]
            ahead += wall[1 + c] * (points[i, 1, c] - points[i, 0, c])
        end = 1 if ahead > 0.0 else 0
    for c in range(3):
        at[0, c] = points[i, end, c]
    if wall[0] == HALF_SPACE:
        return float(wall[4] - normal[0] * at[0, 0] - normal[1] * at[0, 1] - normal[2] * at[0, 2])
    if wall[0] == BOX:
        return _to_box(at[0], wall, normal)
    square = 0.0
    for c in range(3):
        normal[c] = at[0, c] - wall[1 + c]
        square += normal[c] * normal[c]
    length = np.sqrt(square)
    for c in range(3):
        normal[c] *= wall[5] / max(length, _SHORTEST)
    return float(wall[5] * (wall[4] - length))


@part
def _distance(
    points: np.ndarray,
    bodies: np.ndarray,
    walls: np.ndarray,
    i: int,
    j: int,
    at: np.ndarray,
    normal: np.ndarray,
) -> float:
    """The distance of a body i from the body or wall j of a pair [m].

    `at` (2, 3) receives the nearest points, but not that of a wall, and `normal` (3,) the direction
    from i to j; zeros if there is none.
    """
    if j < 0:
        return _to_wall(points, i, walls[-1 - j], at, normal) - bodies[i].radius
    _nearest_points(points, i, j, at)
    square = 0.0
    for c in range(3):
        normal[c] = at[1, c] - at[0, c]
        square += normal[c] * normal[c]
    length = np.sqrt(square)
    for c in range(3):
        normal[c] = normal[c] / length if square > _NOTHING else 0.0
    return float(length - bodies[i].radius - bodies[j].radius)


@part
def _turn(R: np.ndarray, axis: np.ndarray, angle: float) -> None:
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
def _place(
    q: np.ndarray,
    joints: np.ndarray,
    bodies: np.ndarray,
    frames: np.ndarray,
    lines: np.ndarray,
    points: np.ndarray,
) -> None:
    """Write where joints and bodies of a scene are at q (n,) [rad].

    `frames` (n + 1, 3, 4) receives the pose of the frame that each joint moves, last the base's;
    `lines` (n, 2, 3) each joint's origin [m] and its axis, and `points` (B, 2, 3) the ends of the
    bodies' axes [m], both in the base frame.
    """
    n = len(q)
    for i in range(3):
        for j in range(4):
            frames[n, i, j] = 1.0 if i == j else 0.0
    for k in range(n):
        joint = joints[k]
        before = joint.before
        axis = joint.axis
        parent = frames[joint.parent]  # the base's is the last one, at BASE
        H = frames[k]
        for i in range(3):
            for j in range(4):
                H[i, j] = parent[i, 3] if j == 3 else 0.0
                for c in range(3):
                    H[i, j] += parent[i, c] * before[c, j]
        for i in range(3):
            lines[k, 0, i] = H[i, 3]
            lines[k, 1, i] = 0.0
            for c in range(3):
                lines[k, 1, i] += H[i, c] * axis[c]
            if joint.is_prismatic:
                H[i, 3] += q[k] * lines[k, 1, i]
        if not joint.is_prismatic:
            _turn(H, axis, q[k])
    for i in range(len(bodies)):
        ends = bodies[i].ends
        H = frames[bodies[i].moved_by]
        for end in range(2):
            for c in range(3):
                points[i, end, c] = H[c, 3]
                for j in range(3):
                    points[i, end, c] += H[c, j] * ends[end, j]


@part
def _add_motion(
    row: np.ndarray,
    lines: np.ndarray,
    joints: np.ndarray,
    last: int,
    normal: np.ndarray,
    p: np.ndarray,
    sign: float,
) -> None:
    """Add to row (n,) how fast the joints move a point along a normal: row dq [m/s].

    A joint with the axis z through o moves p by z x (p - o), a prismatic one by z. `last` is
    the last one that moves the point, `sign` -1 for what is subtracted.
    """
    k = last
    while k != BASE:
        for a in range(3):
            b = (a + 1) % 3
            c = (a + 2) % 3
            z = sign * lines[k, 1, a]
            if joints[k].is_prismatic:
                row[k] += z * normal[a]
            else:
                row[k] += z * (p[b] - lines[k, 0, b]) * normal[c]
                row[k] -= z * (p[c] - lines[k, 0, c]) * normal[b]
        k = joints[k].parent


@compiled(several(_ROWS, _VECTOR, _INDICES)(vector(), float64, *_SCENE))
def approaches(
    q: np.ndarray,
    reach: float,
    joints: np.ndarray,
    bodies: np.ndarray,
    pairs: np.ndarray,
    walls: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The pairs that are nearer than `reach`, and how joints change that: n' (J_i - J_j) of each.

    Returns:
        Rows C (r, n), so that C dq is the speed of approach [m/s]; the distances (r,) [m]; and
        which pair each belongs to, (r,). What no joint can change is left out.
    """
    n = len(q)
    frames = np.empty((n + 1, 3, 4))
    lines = np.empty((n, 2, 3))
    points = np.empty((len(bodies), 2, 3))
    _place(q, joints, bodies, frames, lines, points)
    at = np.empty((2, 3))
    normal = np.empty(3)
    C = np.empty((len(pairs), n))
    distance = np.empty(len(pairs))
    who = np.empty(len(pairs), np.int64)
    count = 0
    for pair in range(len(pairs)):
        i = pairs[pair, 0]
        j = pairs[pair, 1]
        distance[count] = _distance(points, bodies, walls, i, j, at, normal)
        if not distance[count] < reach:
            continue
        row = C[count]
        for k in range(n):
            row[k] = 0.0
        _add_motion(row, lines, joints, bodies[i].moved_by, normal, at[0], 1.0)
        if j >= 0:
            _add_motion(row, lines, joints, bodies[j].moved_by, normal, at[1], -1.0)
        square = 0.0
        for k in range(n):
            square += row[k] * row[k]
        if square > _NOTHING:
            who[count] = pair
            count += 1
    return C[:count], distance[:count], who[:count]


@compiled(
    several(float64[::1], float64[::1])(
        *(vector(), vector(), vector(), float64, float64, vector(), int64, float64), *_SCENE
    )
)
def least_on_path(
    q: np.ndarray,
    dq: np.ndarray,
    A: np.ndarray,
    T: float,
    gap: float,
    max_point_jacobian: np.ndarray,
    step: int,
    enough: float,
    joints: np.ndarray,
    bodies: np.ndarray,
    pairs: np.ndarray,
    walls: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """The least distance of each pair while the joints move by dq in a tick and then brake to rest.

    Ticks are left out in which no pair can be nearer than `enough` [m], whatever its direction
    (conservative advancement: Mirtich, Impulse-based dynamic simulation, 1996). `step` is the least
    number of ticks between looks; with 1 none is missed, unless joints brake for a thousand ticks.

    Returns:
        The distances, (P,) [m], those below `enough` exact; and after how many ticks, (P,). Minus
        infinity for joints so fast that they brake for longer than anybody would wait for this.
    """
    n = len(q)
    frames = np.empty((n + 1, 3, 4))
    lines = np.empty((n, 2, 3))
    points = np.empty((len(bodies), 2, 3))
    at = np.empty((2, 3))
    normal = np.empty(3)
    ahead = np.empty(n)
    least = np.full(len(pairs), np.inf)
    ticks = np.ones(len(pairs))
    last = 1.0
    for k in range(n):
        last = max(last, 1.0 + np.floor(abs(dq[k]) / (A[k] * T)))
    if not last < _LONGEST:
        least[:] = -np.inf
        return least, ticks
    stride = max(float(step), np.floor(last / _LOOKS))
    far = np.full(len(pairs), -np.inf)  # for how long a path from the first tick on each pair is
    path = 0.0
    tick = 1.0
    while True:
        for k in range(n):
            speed = abs(dq[k])
            moving = min(tick, 1.0 + np.floor(speed / (A[k] * T)))
            moved = gap * T * moving * (speed - A[k] * T * (moving - 1.0) / 2.0)
            ahead[k] = q[k] + (moved if dq[k] > 0.0 else -moved)
        _place(ahead, joints, bodies, frames, lines, points)
        nearest = np.inf
        for pair in range(len(pairs)):
            if not path <= far[pair]:
                i = pairs[pair, 0]
                distance = _distance(points, bodies, walls, i, pairs[pair, 1], at, normal)
                far[pair] = path + distance - enough
                if distance < least[pair]:
                    least[pair] = distance
                    ticks[pair] = tick
            nearest = min(nearest, far[pair])
        looked = tick
        while tick < last and (tick < looked + stride or path <= nearest):
            for k in range(n):
                path += max_point_jacobian[k] * gap * T * max(abs(dq[k]) - A[k] * T * tick, 0.0)
            tick += 1.0
        if tick == looked or path <= nearest:
            return least, ticks


@compiled(
    several(_ROWS, _VECTOR, _INDICES)(
        *(matrix(), vector(), vector(int64), vector(), vector(), float64),
        *(vector(), vector(), float64, float64, float64, float64, float64),
    )
)
def braking_rows(
    C: np.ndarray,
    distance: np.ndarray,
    who: np.ndarray,
    v: np.ndarray,
    slope: np.ndarray,
    ticks: float,
    distance_now: np.ndarray,
    A: np.ndarray,
    T: float,
    gap: float,
    rate: float,
    clearance: float,
    lever: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """C S (dq - v) <= d - d_s - b at a place of a braking arm, unless all allowed motion keeps it.

    DistanceLimit says what these are. `distance_now` (P,) is that of each pair, infinite if it is
    far; `lever` is the largest element of max_point_jacobian.

    Returns:
        Rows (j, n), their upper ends (j,), and which pair each belongs to, (j,).
    """
    r, n = C.shape
    rows = np.empty((r, n))
    high = np.empty(r)
    kept = np.empty(r, np.int64)
    count = 0
    bend = 0.0  # how far the arm leaves the tangent, for a change of A T in every joint
    for j in range(n):
        bend += 0.5 * lever * (slope[j] * A[j] * T) ** 2
    for i in range(r):
        before = 0.0  # |C|^2
        after = 0.0  # of the row
        braking = 0.0
        reach = 0.0
        for j in range(n):
            # The chord of s that is on the safe side: it becomes steeper with the speed.
            chord = slope[j] + 0.5 * gap * T * np.sign(C[i, j] * v[j])
            rows[count, j] = C[i, j] * min(chord, gap * T * ticks)
            before += C[i, j] * C[i, j]
            after += rows[count, j] * rows[count, j]
            braking += rows[count, j] * v[j]
            reach += abs(rows[count, j]) * 2.0 * T * A[j]
        margin = distance[i] - clearance
        if after == 0.0 or not margin - bend < reach:
            continue
        size = _WEIGHT * np.sqrt(before / after)  # as long as the other rows, times the weight
        # What is inside already comes out again as slowly as by the damper, and after the others:
        # nothing else gets inside for it.
        if margin < 0.0 and distance_now[who[i]] < clearance - _INSIDE:
            margin *= min(rate * T, 1.0)
            size /= _WEIGHT
        for j in range(n):
            rows[count, j] *= size
        high[count] = size * (margin - bend + braking)
        kept[count] = who[i]
        count += 1
    return rows[:count], high[:count], kept[:count]
