"""The paper's arm, laws and sampled loop once more, from the equations alone: nothing here imports
the package.

Kinematics from the Denavit-Hartenberg table instead of a URDF; M and n from the links' Jacobians
and the principle of virtual power instead of recursive algorithms; the laws from explicit inverses
instead of factorizations. All arrays have a leading axis (B, ...) for loops that run side by side.
"""

from dataclasses import dataclass

import numpy as np

ALPHA = np.radians((90.0, -90.0, -90.0, 90.0, 90.0, -90.0, 0.0))
BARE = np.array((0.3105, 0.0, 0.400, 0.0, 0.390, 0.0, 0.078))  # d [m], LWR IV
PAPER = np.array((0.323, 0.0, 0.400, 0.0, 0.390, 0.0, 0.213))  # d [m], base raised, with tool
Q0 = np.radians((28.08, 104.12, 114.59, 94.85, 14.32, -28.12, 0.0))  # q(0) of Section 5
POINTS = np.array(
    ((-0.4, 0.36, 0.01), (-0.4, -0.36, 0.01), (-0.4, -0.36, 1.16), (-0.4, 0.36, 1.16))
)  # x_0 ... x_3 [m]
GRAVITY = np.array((0.0, 0.0, 9.81))  # acceleration of a frame at rest [m/s^2]

# law: exponent p of W = M^p; whether b holds lambda dq_{k-1}; whether b holds -T M^-1 n
LAWS = {
    'minimum_velocity': (0, 0.0, 0.0),
    'minimum_acceleration': (0, 1.0, 0.0),
    'minimum_kinetic_energy': (1, 0.0, 0.0),
    'minimum_weighted_torque': (0, 1.0, 1.0),
    'dynamically_consistent': (1, 1.0, 1.0),
    'minimum_torque': (2, 1.0, 1.0),
}


@dataclass(frozen=True)
class Links:
    """d (7,) [m]; mass (7,) [kg]; com (7, 3) [m] and inertia (7, 3, 3) [kg m^2] about it, both in
    the frame on the joint with z along the axis; rotors (7,) [kg m^2].
    """

    d: np.ndarray
    mass: np.ndarray
    com: np.ndarray
    inertia: np.ndarray
    rotors: np.ndarray


def cylinders(d: np.ndarray) -> Links:
    """Section 5.2 with solid cylinders: 1 kg, radius 0.06 m, from the joint along z over the length
    max(d, 1 mm).
    """
    across = (3 * 0.06**2 + np.maximum(d, 0.001) ** 2) / 12
    along = np.full(7, 0.06**2 / 2)
    com = np.stack((np.zeros(7), np.zeros(7), d / 2), axis=1)
    return Links(
        d,
        np.ones(7),
        com,
        np.array([np.diag(row) for row in zip(across, across, along, strict=True)]),
        np.zeros(7),
    )


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a x b along the last axis; np.cross takes its time with small arrays."""
    a0, a1, a2, b0, b1, b2 = *(a[..., i] for i in range(3)), *(b[..., i] for i in range(3))
    return np.stack((a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0), axis=-1)


def transposed(matrices: np.ndarray) -> np.ndarray:
    """Of a stack of matrices, each. What numpy 2 calls .mT, which Ubuntu 24.04's numpy has not."""
    return matrices.swapaxes(-1, -2)


def weigh(vectors: np.ndarray, dq: np.ndarray) -> np.ndarray:
    """Sum over the joints of dq_j times their vectors: (B, point, joint, 3) and (B, 7) give (B,
    point, 3).
    """
    return (dq[:, None, None, :] @ vectors)[:, :, 0]


def frames(d: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Orientations (B, 7, 3, 3) and origins (B, 7, 3) of the frames on the joints, tip (B, 3)."""
    cos = np.cos(q)
    sin = np.sin(q)
    R = np.empty((len(q), 7, 3, 3))
    o = np.empty((len(q), 7, 3))
    before = np.eye(3)
    x = np.zeros((len(q), 3))
    for i in range(7):
        turn = np.zeros((len(q), 3, 3))
        turn[:, 0, 0] = cos[:, i]
        turn[:, 0, 1] = -sin[:, i]
        turn[:, 1, 0] = sin[:, i]
        turn[:, 1, 1] = cos[:, i]
        turn[:, 2, 2] = 1.0
        R[:, i] = before @ turn
        o[:, i] = x
        x = x + d[i] * R[:, i, :, 2]
        c = np.cos(ALPHA[i])
        s = np.sin(ALPHA[i])
        before = R[:, i] @ np.array(((1.0, 0.0, 0.0), (0.0, c, -s), (0.0, s, c)))
    return R, o, x


def evaluate(
    links: Links, q: np.ndarray, dq: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """x (B, 3), J (B, 3, 7), M (B, 7, 7) and n (B, 7) at q, dq (B, 7)."""
    R, o, x = frames(links.d, q)
    z = R[..., 2]
    moves = np.tri(7)[:, :, None]  # (B, joint, 3); (link, joint, 1)
    p = o + (R @ links.com[..., None])[..., 0]  # (B, link, 3) centres of mass
    lever = p[:, :, None] - o[:, None]  # (B, link, joint, 3)
    Jv = moves * cross(z[:, None], lever)
    Jw = moves * z[:, None]  # (B, link, joint, 3)
    w = weigh(Jw, dq)
    v = weigh(Jv, dq)  # of the links
    vo = weigh(moves * cross(z[:, None], o[:, :, None] - o[:, None]), dq)  # of the joints
    dz = cross(w, z)
    a = weigh(
        moves * (cross(dz[:, None], lever) + cross(z[:, None], v[:, :, None] - vo[:, None])), dq
    )
    dw = weigh(moves * dz[:, None], dq)
    inertia = R @ links.inertia @ transposed(R)  # (B, link, 3, 3)
    force = links.mass[:, None] * (a + GRAVITY)
    moment = (inertia @ dw[..., None])[..., 0] + cross(w, (inertia @ w[..., None])[..., 0])
    n = (Jv @ force[..., None] + Jw @ moment[..., None])[..., 0].sum(axis=1)
    straight = Jv @ (links.mass[:, None, None] * transposed(Jv))
    turning = Jw @ inertia @ transposed(Jw)
    M = (straight + turning).sum(axis=1) + np.diag(links.rotors)
    return x, transposed(cross(z, x[:, None] - o)), M, n


def quintic(xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """s and ds/dxi of Eq. (36), multiplied out as in the paper."""
    return 6 * xi**5 - 15 * xi**4 + 10 * xi**3, 30 * xi**4 - 60 * xi**3 + 30 * xi**2


def loop(laws: list[str], k_d: np.ndarray, T: float, q: np.ndarray, t_end: float) -> np.ndarray:
    """q_k (ticks, B, 7) of the paper's task with cylinders, one loop for each row of laws, k_d (B,)
    and q (B, 7).
    """
    links = cylinders(PAPER)
    rows = np.arange(len(laws))
    power, memory, gravity = (
        np.array(column)[:, None] for column in zip(*(LAWS[law] for law in laws), strict=True)
    )
    forgetting_factor = 1.0 - k_d[:, None] * T
    dq = np.zeros_like(q)
    segment = np.zeros(len(q), dtype=int)
    begun = np.zeros(len(q))
    history = []
    for k in range(round(t_end / T)):
        history.append(q)
        x, J, M, n = evaluate(links, q, dq)
        over = (
            (k * T - begun > 3.0 - 1e-9)
            & (np.linalg.norm(POINTS[segment + 1] - x, axis=1) < 0.001)
            & (segment < 2)
        )
        segment = segment + over
        begun = np.where(over, k * T, begun)
        s, ds = quintic(np.minimum((k * T - begun) / 3.0, 1.0)[:, None])
        A = POINTS[segment]
        way = POINTS[segment + 1] - POINTS[segment]
        dx = way / 3.0 * ds + 10.0 * (A + way * s - x)
        M_inv = np.linalg.inv(M)
        b = memory * forgetting_factor * dq - gravity * T * (M_inv @ n[..., None])[..., 0]
        W_inv = np.stack((np.broadcast_to(np.eye(7), M.shape), M_inv, M_inv @ M_inv))[
            power[:, 0], rows
        ]
        J_pinv = W_inv @ transposed(J) @ np.linalg.inv(J @ W_inv @ transposed(J))
        dq = b + (J_pinv @ (dx - (J @ b[..., None])[..., 0])[..., None])[..., 0]
        q = q + T * dq
    return np.array(history)
