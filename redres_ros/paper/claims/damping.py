"""Appendix B of the paper: what becomes of joint velocities once the task has gone."""

import numpy as np

from redres_ros.laws import make_law
from redres_ros.paper.claims.claim import Finding, claim, same_velocities
from redres_ros.paper.runs import SIMULATION_DAMPING, SIMULATION_T, Runs
from redres_ros.resolution import resolve


@claim('B (B.2)', 'Once the task has gone, the joints come to rest at q_0 + T dq_0 / (1 - lambda)')
def _resting_place(runs: Runs) -> Finding:
    T = SIMULATION_T
    first = np.linspace(-1.0, 1.0, 7)  # (n,) [rad/s]
    start = runs.task.start
    dq = first
    q = start
    forgetting_factor = make_law(
        'minimum_acceleration', damping=SIMULATION_DAMPING
    ).forgetting_factor(T)
    for _ in range(5000):
        q = q + T * dq
        dq = resolve(np.zeros((3, 7)), np.zeros(3), forgetting_factor * dq)  # Eq. (B.1)
    miss = float(np.abs(q - (start + T * first / (1.0 - forgetting_factor))).max())
    return Finding(miss <= 1e-12, f'the joints rest {miss:.1e} rad from where Eq. (B.2) says')


@claim(
    'B',
    'k_d up to 1/T: no oscillation; up to 2/T: dies out oscillating; 2/T: for ever; '
    'beyond: diverges',
)
def _regimes(runs: Runs) -> Finding:
    seen = {}
    for fraction in (0.5, 1.5, 2.0, 2.5):
        dq = np.ones(1)
        speeds = []
        for _ in range(60):
            dq = resolve(np.zeros((1, 1)), np.zeros(1), (1.0 - fraction) * dq)  # Eq. (B.1)
            speeds.append(float(dq[0]))
        sign = 'alternating' if speeds[0] * speeds[1] < 0.0 else 'one sign'
        seen[fraction] = (sign, _fate(abs(speeds[-1])))
    expected = {
        0.5: ('one sign', 'dies out'),
        1.5: ('alternating', 'dies out'),
        2.0: ('alternating', 'stays'),
        2.5: ('alternating', 'grows'),
    }
    return Finding(
        seen == expected,
        '; '.join(f'k_d = {fraction:g}/T: {sign}, {end}' for fraction, (sign, end) in seen.items()),
    )


@claim('B', 'With lambda = 0 the joints stop at the next step, at the cost of a high acceleration')
def _stops_at_once(runs: Runs) -> Finding:
    T = SIMULATION_T
    first = np.linspace(-1.0, 1.0, 7)  # (n,) [rad/s]
    law = make_law('minimum_acceleration', damping=1.0 / T)
    dq = resolve(
        np.zeros((3, 7)), np.zeros(3), law.bias(runs.model.state(runs.task.start, first), T)
    )
    speed = float(np.linalg.norm(first))
    return Finding(
        not dq.any(),
        f'from {speed:.2f} rad/s to {float(np.linalg.norm(dq)):g} rad/s in one step of '
        f'{1e3 * T:g} ms, which takes {float(np.linalg.norm(first - dq)) / T:.0f} rad/s^2',
    )


@claim('B', 'With k_d = 1/T the scheme of least acceleration becomes the law of least velocity')
def _full_damping(runs: Runs) -> Finding:
    return same_velocities(runs['difference_2'].max)


def _fate(ratio: float) -> str:
    """What becomes of a speed that is so many times the first one after a while."""
    if ratio < 1e-6:
        return 'dies out'
    return 'grows' if ratio > 1e6 else 'stays'
