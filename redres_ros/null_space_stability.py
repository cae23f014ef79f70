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

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from redres_ros.laws import Law, law_name
from redres_ros.policy import SPEED_LIMIT, Policy, make_policy
from redres_ros.robot_model import RobotModel
from redres_ros.vectors import finite_vector

AT_REST = 1e-3  # [rad/s] of the fastest joint
# [rad/s], [rad/s^2] below which an arm creeps to its place of rest, and does not swing
CREEPING_SPEED = 0.1
CREEPING_ACCELERATION = 0.1
WINDOW = 0.5  # [s] for which either must hold
_STEP = 1e-5  # [rad] of the differences; rounding leaves 1e-16 / 1e-5 beside the field
_HIGHEST_RATE = 1e4  # [Hz] that is tried
_RATES = 100
_NEUTRAL = 1e-5  # an eigenvalue of the loop as near to 1 is a posture that nothing pulls at
_NO_STIFFNESS = 0.01  # [1/s^2] the same of K, whose differences have 1e-3 of noise


@dataclass(frozen=True)
class NullSpaceStability:
    """What becomes of an arm that starts at rest and whose task velocity is zero.

    Attributes:
        arm: Its name.
        law: The law, with its damping.
        T: Sampling time [s].
        comes_to_rest: Whether it is at rest in the end, or creeps towards its place of rest.
        time: When that is, or how long it was looked at [s].
        speed: Of the fastest joint in the end [rad/s].
        q: Where it then is, (n,) [rad].
        stiffness: Eigenvalues kappa of K at q, (r,) complex [1/s^2].
        spectral_radius: Of the loop, linearised at q, but for neutral eigenvalues of 1: by this
            factor small motions change in a tick.
        sufficient_damping: The least one of those tried with which it comes to rest [1/s]; the
            law's own if that does, None if none up to 1/T does.
        sufficient_rate: The least one from which the bound holds at q with the law's damping [Hz];
            None if it holds at no rate.
    """

    arm: str
    law: Law
    T: float
    comes_to_rest: bool
    time: float
    speed: float
    q: np.ndarray
    stiffness: np.ndarray
    spectral_radius: float
    sufficient_damping: float | None
    sufficient_rate: float | None

    @property
    def margin(self) -> float:
        """1 - spectral radius: negative if small motions grow."""
        return 1.0 - self.spectral_radius

    def __str__(self) -> str:
        setting = f'{law_name(self.law)} at {1.0 / self.T:g} Hz with damping {self.law.damping:g}'
        if self.comes_to_rest:
            return f'{setting} comes to rest on {self.arm} within {self.time:.1f} s'
        advice = 'choose another law'
        if self.sufficient_damping is not None:
            advice = f'with damping {self.sufficient_damping:g} it does'
        elif self.sufficient_rate is not None and self.sufficient_rate * self.T > 1.0:
            advice = f'no damping helps, a rate from {self.sufficient_rate:.0f} Hz does'
        return (
            f'{setting} does not come to rest on {self.arm}: with no task velocity a joint still '
            f'moves at {self.speed:.3g} rad/s after {self.time:.0f} s; {advice}'
        )


def stability(
    model: RobotModel, law: str | Law | Policy, T: float, q: np.ndarray, duration: float = 30.0
) -> NullSpaceStability:
    """Whether the arm comes to rest from q if the task velocity is zero.

    The law itself is followed for a while, because far from rest terms count that are quadratic in
    the velocity. At the place where it ends the loop is linearised. If the arm does not come to
    rest, larger dampings are tried, each twice the one before.

    Args:
        model: The arm.
        law: A name in LAWS, a law, or a policy with the task, preferences and limits in force.
        T: Sampling time [s].
        q: Where the arm is at rest, (n,) [rad].
        duration: Longest time for which the motion is followed [s].

    Raises:
        RangeError: The damping is beyond 1/T.
        UnknownNameError: No law has that name.
        ArrayError: q does not fit the arm, or is not finite.
    """
    policy = _policy(model, law)
    policy.check(model, T)
    q = finite_vector(q, model.n, 'q')
    policy = policy.with_initial_targets(model.unchecked_state(q, np.zeros(model.n)))
    found = _followed(model, policy, T, q, duration)
    damping = policy.law.damping
    while found.sufficient_damping is None and damping < 1.0 / T:
        damping = min(max(2.0 * damping, 1.0), 1.0 / T)
        stronger = replace(policy, law=replace(policy.law, damping=damping))
        if _followed(model, stronger, T, q, duration).comes_to_rest:
            found = replace(found, sufficient_damping=damping)
    return found


def linearised(
    model: RobotModel, law: str | Law | Policy, T: float, q: np.ndarray
) -> tuple[np.ndarray, float]:
    """The eigenvalues kappa of K at q, (r,) [1/s^2], and the spectral radius of the loop there.

    The law itself is differentiated, so this holds for any law. At a posture where the arm does not
    rest it says how neighbouring motions diverge.

    Args:
        model: The arm.
        law: A name in LAWS, a law, or a policy; limits are left out.
        T: Sampling time [s].
        q: The posture, (n,) [rad].
    """
    policy = _policy(model, law)
    rest = np.zeros(model.n)
    J = policy.task.jacobian(model.state(q, rest))
    Z = np.linalg.svd(J)[2][np.linalg.matrix_rank(J) :].T  # (n, r)
    r = Z.shape[1]

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


def _policy(model: RobotModel, law: str | Law | Policy) -> Policy:
    return law if isinstance(law, Policy) else make_policy(model, law)


def _followed(
    model: RobotModel, policy: Policy, T: float, q: np.ndarray, duration: float
) -> NullSpaceStability:
    """What becomes of the arm from rest at q (n,) [rad], within `duration` [s]."""
    dx = np.zeros(policy.task.size)
    dq = np.zeros(model.n)
    speed = 0.0
    at_rest = 0  # ticks
    creeping = 0
    ticks = 0
    while at_rest * T < WINDOW and ticks * T < duration:
        ticks += 1
        dq_prev = dq
        dq = policy.solve(model.unchecked_state(q, dq_prev), dx, T).dq
        speed = float(np.abs(dq).max())
        if not speed < SPEED_LIMIT:
            creeping = 0
            break
        q = q + T * dq
        acceleration = float(np.abs(dq - dq_prev).max()) / T
        is_creeping = speed < CREEPING_SPEED and acceleration < CREEPING_ACCELERATION
        at_rest = at_rest + 1 if speed < AT_REST else 0
        creeping = creeping + 1 if is_creeping else 0
    stiffness, spectral_radius = linearised(model, policy, T, q)
    comes_to_rest = max(at_rest, creeping) * T >= WINDOW
    damping = policy.law.damping
    urdf = model.arm.urdf
    return NullSpaceStability(
        urdf.stem if isinstance(urdf, Path) else 'this arm',
        policy.law,
        T,
        comes_to_rest,
        ticks * T,
        speed,
        q,
        stiffness,
        spectral_radius,
        damping if comes_to_rest else None,
        _sufficient_rate(stiffness, damping, T),
    )


def _sufficient_rate(stiffness: np.ndarray, damping: float, T: float) -> float | None:
    """The least rate [Hz], 1/T or a higher one, at which every kappa keeps the bound; or None."""
    pulling = stiffness[np.abs(stiffness) > _NO_STIFFNESS].tolist()
    for rate in np.geomspace(1.0 / T, max(1.0 / T, _HIGHEST_RATE), _RATES).tolist():
        if all(is_stable(kappa, damping, 1.0 / rate) for kappa in pulling):
            return float(rate)
    return None
