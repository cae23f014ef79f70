"""The escape direction from a singularity, where the Jacobian alone shows none.

In the stretched arm no joint velocity moves the tip along the arm: J dq = dx has no part in that
direction u. But to second order a self-motion dq = z does: with H = sum_c u_c dJ_c/dq,

    u' ddx = z' H z,

and so the self-motion that takes the tip along u the most is the eigenvector of H, within the null
space, that belongs to the largest eigenvalue. If none is positive, there is no escape, as for
the outward direction of the stretched arm.
"""

import numpy as np

from redres_ros.kernels.closed_form import SINGULAR_RATIO

# of the threshold below which a direction is damped: above it, the damped motion escapes
_STUCK = 0.1
# fraction of a task velocity; where less can be executed, its components lock each other
_LOCKED = 0.2
_NOTHING = 1e-9  # of dx, counts as zero; of H, is no escape


def escape_direction(
    J: np.ndarray, dJ: np.ndarray, dx: np.ndarray, dq_prev: np.ndarray
) -> np.ndarray | None:
    """A self-motion (n,) that leaves a singularity as fast as the task demands; or None.

    Args:
        J: (m, n) Jacobian of the task, with comparable rows.
        dJ: (n, m, n) its derivatives by each joint.
        dx: (m,) the task velocity.
        dq_prev: (n,) [rad/s] the last command; the motion goes on in its sense.
    """
    U, s, Vt = np.linalg.svd(J)
    e = SINGULAR_RATIO * s[0]
    if e == 0.0:
        return None
    kept = int(np.count_nonzero(s >= e))
    stuck = np.maximum(1.0 - s[kept:] / (_STUCK * e), 0.0)  # 1 at the singularity
    lost = U[:, kept : len(s)]
    asked = lost.dot(stuck * lost.T.dot(dx))  # (m,)
    size = float(np.linalg.norm(asked))
    if size <= _NOTHING * float(np.linalg.norm(dx)):
        return None
    H = np.einsum('c,icj->ij', asked / size, dJ)  # (n, n)
    Z = Vt[kept:].T  # (n, n - kept)
    curvatures, directions = np.linalg.eigh(Z.T.dot(H + H.T).dot(Z) / 2.0)
    if curvatures[-1] <= _NOTHING * float(np.linalg.norm(H)):
        return None
    z: np.ndarray = Z.dot(directions[:, -1])
    sense = z.dot(dq_prev) or z[np.argmax(np.abs(z))]
    return np.copysign(size, sense) * z


def locked(executed: float) -> float:
    """How far a task velocity counts as locked, if this fraction of it can be executed.

    1 if none can be, 0 from a fifth on, and continuous between: what takes the place of a locked
    velocity is blended in.
    """
    return max(1.0 - executed / _LOCKED, 0.0)
