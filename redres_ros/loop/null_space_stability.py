"""Whether a law brings the null space to rest when the task velocity is zero.

A law with a velocity history makes the null space a dynamic system. About a posture q, with z and v
the coordinates of position and velocity in the null space of the task,

    v_k = lambda v_{k-1} - T K z_k,   z_{k+1} = z_k + T v_k,   lambda = 1 - k_d T.

Appendix B is the case K = 0. The torque laws add -T M^-1 n to the bias, in which gravity is a field
that depends on q: K = -dF/dz (r, r), where F is the null-space acceleration of the law at rest. K
is symmetric only for W = M, so its eigenvalues kappa = a + i b may be complex. Those of the loop
are the roots of mu^2 - (1 + lambda - T^2 kappa) mu + lambda = 0. By the criterion of Schur and Cohn
they are inside the unit circle if and only if 0 < k_d T < 2 and

    (b / k_d)^2 < 2 a / (2 - k_d T) - (T a / (2 - k_d T))^2,

which is k_d^2 a > b^2 for T -> 0. For a < 0 no damping is enough: the arm leaves that posture.
"""

from dataclasses import replace

import numpy as np

from redres_ros.laws import Law, law_name
from redres_ros.policy import Policy, make_policy
from redres_ros.robot_model import RobotModel

_STEP = 1e-5  # [rad] of the differences; rounding leaves 1e-16 / 1e-5 beside the field
_NEUTRAL = 1e-5  # an eigenvalue of the loop as near to 1 is a posture that nothing pulls at
_NO_STIFFNESS = 0.01  # [1/s^2] the same of K, whose differences have 1e-3 of noise
_POSTURES = 40
_RANGE = 3.0  # [rad] of joints that turn further
# Of the postures. With fewer an arm finds a place of rest; those beside singularities are noise.
_ALLOWED = 0.05


def swing_warning(model: RobotModel, law: str | Law | Policy, T: float) -> str:
    """Why the null space may swing for ever while the task velocity is zero; '' if it does not.

    The bound is looked at where the law pulls the arm back, a > 0, at random postures: 0.1 s.

    Args:
        model: The arm.
        law: A name in LAWS, a law, or a policy; limits and secondary tasks are left out.
        T: Sampling time [s].
    """
    policy = law if isinstance(law, Policy) else make_policy(model, law)
    if not policy.law.has_memory:
        return ''
    random = np.random.default_rng(0)
    lower = np.maximum(model.q_min, -_RANGE)
    upper = np.minimum(model.q_max, _RANGE)
    postures = random.uniform(lower, upper, (_POSTURES, model.n))
    found = [linearised(model, policy, T, q)[0] for q in postures]
    damping = policy.law.damping
    share = _swinging(found, damping, T)
    if share <= _ALLOWED:
        return ''
    advice = 'no damping up to 1/T is enough, choose another law'
    for factor in (2.0, 4.0, 8.0, 16.0, 32.0):
        stronger = factor * max(damping, 1.0)
        if stronger <= 1.0 / T and _swinging(found, stronger, T) <= _ALLOWED:
            advice = f'damping {stronger:g} is enough'
            break
    return (
        f'{law_name(policy.law)} at T = {T:g} s with damping k_d = {damping:g} may swing for ever '
        f'while no task moves: in {share:.0%} of random postures the null space does not keep '
        f'(b/k_d)^2 < 2a/(2 - k_d T) - (T a/(2 - k_d T))^2; {advice}'
    )


def linearised(
    model: RobotModel, law: str | Law | Policy, T: float, q: np.ndarray
) -> tuple[np.ndarray, float]:
    """The eigenvalues kappa of K at q, (r,) [1/s^2], and the spectral radius of the loop there.

    The law itself is differentiated, so this holds for any law. At a posture where the arm does not
    rest it says how neighbouring motions diverge.

    Args:
        model: The arm.
        law: A name in LAWS, a law, or a policy; limits and secondary tasks are left out.
        T: Sampling time [s].
        q: The posture, (n,) [rad].
    """
    policy = law if isinstance(law, Policy) else make_policy(model, law)
    rest = np.zeros(model.n)
    state = model.state(q, rest)
    policy = replace(policy, secondary_tasks=(), limits=None).with_initial_targets(state)
    J = policy.task.jacobian(state)
    Z = np.linalg.svd(J)[2][np.linalg.matrix_rank(J) :].T  # (n, r)
    r = Z.shape[1]
    if not r:
        return np.zeros(0), 0.0

    def velocity(q: np.ndarray, dq_prev: np.ndarray) -> np.ndarray:
        state = model.unchecked_state(q, dq_prev)
        return Z.T.dot(policy.unconstrained(state, np.zeros(len(J)), T).dq)

    D_q = np.empty((r, r))  # dv_k / dz_k
    D_v = np.empty((r, r))  # dv_k / dv_{k-1}
    for i in range(r):
        step = _STEP * Z[:, i]
        D_q[:, i] = (velocity(q + step, rest) - velocity(q - step, rest)) / (2.0 * _STEP)
        D_v[:, i] = (velocity(q, step) - velocity(q, -step)) / (2.0 * _STEP)
    loop = np.block([[np.eye(r) + T * D_q, T * D_v], [D_q, D_v]])  # of (z_k, v_{k-1})
    mu = np.linalg.eigvals(loop)
    moving = mu[np.abs(mu - 1.0) > _NEUTRAL]
    return np.linalg.eigvals(-D_q / T), float(np.abs(moving).max(initial=0.0))


def is_stable(kappa: complex, damping: float, T: float) -> bool:
    """Whether a null-space motion with this eigenvalue of K comes to rest: the bound above.

    Args:
        kappa: a + i b [1/s^2].
        damping: k_d [1/s].
        T: Sampling time [s].
    """
    if not 0.0 < damping * T < 2.0:
        return False
    h = 2.0 - damping * T
    a = kappa.real
    return (kappa.imag / damping) ** 2 < 2.0 * a / h - (T * a / h) ** 2


def _swinging(found: list[np.ndarray], damping: float, T: float) -> float:
    """The fraction of postures, each given by its kappas, at which the arm swings."""
    count = 0
    for stiffness in found:
        pulling = stiffness[stiffness.real > _NO_STIFFNESS].tolist()
        count += not all(is_stable(kappa, damping, T) for kappa in pulling)
    return count / len(found)
