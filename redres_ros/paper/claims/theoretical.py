"""Claims of Sections 2 to 4 and of the appendices: identities, optimality, stability, cost."""

import time
from collections.abc import Iterator

import numpy as np
from scipy.linalg import null_space

from redres_ros.controller import Controller
from redres_ros.laws import LAWS, make_law
from redres_ros.paper.claims.claim import ROUNDING, Claim, Finding
from redres_ros.paper.figures.runs import SIMULATION_DAMPING, SIMULATION_T, Runs
from redres_ros.paper.second_order import SCHEMES, SecondOrderController, make_scheme
from redres_ros.resolution import resolve
from redres_ros.robot_model import RobotModel, RobotState
from redres_ros.simulation.recording import Recording

_EVERY = 50  # ticks between the states of a run at which something is checked
_REPETITIONS = 3000  # of a tick when it is timed


def states(
    recording: Recording, model: RobotModel, every: int = _EVERY
) -> Iterator[tuple[RobotState, np.ndarray]]:
    """States along a recording and the velocities commanded there.

    Args:
        recording: Of a motion.
        model: Of the arm.
        every: Ticks from one state to the next.
    """
    q = recording.vectors('q1')
    dq = recording.vectors('dq1')
    for k in range(every, len(q), every):
        yield model.state(q[k], dq[k - 1]), dq[k]


def square_task(runs: Runs) -> Finding:
    """Six joints and six task variables: the sampled acceleration law against J^-1 dx, along a
    recorded motion.
    """
    T = SIMULATION_T
    model = RobotModel.named(runs.task.robot)
    recording = runs.ideal_damped
    q = recording.vectors('q1')
    dq = recording.vectors('dq1')[:, :6]  # joint 7 stands still
    worst = 0.0
    J_prev = np.zeros((6, 6))
    dq_prev = np.zeros(6)
    for k in range(len(q) // 3):
        J = model.state(q[k], np.zeros(7)).J[:, :6]
        dx = J @ dq[k]
        dx_prev = J_prev @ dq_prev
        ddq = np.linalg.solve(J, (dx - dx_prev) / T - (J - J_prev) / T @ dq_prev)  # Eq. (12)
        sampled = dq_prev + T * ddq  # Eq. (13)
        direct = np.linalg.solve(J, dx)  # Eq. (14)
        worst = max(worst, float(np.linalg.norm(sampled - direct)))
        J_prev = J
        dq_prev = dq[k]
    return Finding(
        worst <= ROUNDING, f'largest difference {worst:.1e} rad/s over the first third of the task'
    )


def two_forms(runs: Runs) -> Finding:
    """(15) against (17) with an explicit pseudoinverse."""
    worst = 0.0
    for state, dq in states(runs.ideal_undamped, runs.model):
        J_pinv = np.linalg.pinv(state.J[:3])
        dx = state.J[:3] @ dq
        b = state.dq_prev
        form_15 = J_pinv @ dx + (np.eye(len(b)) - J_pinv @ state.J[:3]) @ b
        form_17 = b + J_pinv @ (dx - state.J[:3] @ b)
        worst = max(worst, float(np.linalg.norm(form_15 - form_17)))
    return Finding(worst <= ROUNDING, f'largest difference {worst:.1e} rad/s')


def special_case_35(runs: Runs) -> Finding:
    """(32) with the damping torque (34) against (35), written out."""
    T = SIMULATION_T
    worst = 0.0
    for state, dq in states(runs.ideal_35, runs.model):
        Minv = np.linalg.inv(state.M)
        dx = state.J[:3] @ dq
        J_M = Minv @ state.J[:3].T @ np.linalg.inv(state.J[:3] @ Minv @ state.J[:3].T)  # Eq. (A.5)
        P_M = np.eye(len(dq)) - J_M @ state.J[:3]  # Eq. (33)
        tau_N = -state.M @ state.dq_prev / T  # Eq. (34)
        form_32 = J_M @ dx + P_M @ (state.dq_prev - T * Minv @ (state.n - tau_N))
        form_35 = J_M @ dx - T * P_M @ Minv @ state.n
        worst = max(worst, float(np.linalg.norm(form_32 - form_35)))
    return Finding(worst <= ROUNDING, f'largest difference {worst:.1e} rad/s')


def optimality(runs: Runs) -> Finding:
    """Z' W (dq - b), Z spanning the null space of J, relative to its terms: zero at the constrained
    minimum.
    """
    worst = {}
    for name in LAWS:
        law = make_law(name)
        residuals = []
        for state, moved in states(runs.ideal_damped, runs.model):
            b = law.bias(state, SIMULATION_T)
            W = law.weight(state)
            Z = null_space(state.J[:3])
            dq = resolve(state.J[:3], state.J[:3] @ moved, b, W)
            W = np.eye(len(b)) if W is None else np.asarray(W)
            size = np.linalg.norm(W) * np.linalg.norm(dq - b)
            residuals.append(np.linalg.norm(Z.T @ W @ (dq - b)) / size)
        worst[name] = max(residuals)
    return Finding(
        bool(max(worst.values()) <= 1e-9),
        'largest relative residual ' + ', '.join(f'{name} {r:.0e}' for name, r in worst.items()),
    )


def resting_place(runs: Runs) -> Finding:
    """A task that has vanished: where the joints come to rest, against (B.2)."""
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


def regimes(runs: Runs) -> Finding:
    """Signs and growth of a null-space velocity for k_d T = 0.5, 1.5, 2 and 2.5."""
    seen = {}
    for share in (0.5, 1.5, 2.0, 2.5):
        dq = np.ones(1)
        speeds = []
        for _ in range(60):
            dq = resolve(np.zeros((1, 1)), np.zeros(1), (1.0 - share) * dq)  # Eq. (B.1)
            speeds.append(float(dq[0]))
        sign = 'alternating' if speeds[0] * speeds[1] < 0.0 else 'one sign'
        seen[share] = (sign, _fate(abs(speeds[-1])))
    expected = {
        0.5: ('one sign', 'dies out'),
        1.5: ('alternating', 'dies out'),
        2.0: ('alternating', 'stays'),
        2.5: ('alternating', 'grows'),
    }
    return Finding(
        seen == expected,
        '; '.join(f'k_d = {share:g}/T: {sign}, {end}' for share, (sign, end) in seen.items()),
    )


def _fate(ratio: float) -> str:
    """What becomes of a speed that is so many times the first one after a while."""
    if ratio < 1e-6:
        return 'dies out'
    return 'grows' if ratio > 1e6 else 'stays'


def cost(runs: Runs) -> Finding:
    """Time of a tick of each law and of its scheme, measured in turns."""
    ratios = {}
    state, moved = next(states(runs.ideal_damped, runs.model, 1000))
    dx = state.J[:3] @ moved
    for name in SCHEMES:
        law = Controller(runs.model, make_law(name), SIMULATION_T)
        scheme = SecondOrderController(runs.model, make_scheme(name), SIMULATION_T)
        pairs = [
            (_seconds(law, state.q, dx), _seconds(scheme, state.q, dx)) for _ in range(_REPETITIONS)
        ]
        ratios[name] = float(np.median([one / two for one, two in pairs]))
    return Finding(
        max(ratios.values()) <= 1.05,
        'time of a tick, velocity law over second-order scheme: '
        + ', '.join(f'{name} {ratio:.2f}' for name, ratio in ratios.items()),
        'medians of pairs measured in turns; both evaluate the same model',
    )


def proportional(runs: Runs) -> Finding:
    """Order of convergence to the continuous scheme on the first segment."""
    orders = {name: found.q_order for name, found in runs.convergences.items()}
    return Finding(
        all(0.9 <= order <= 1.1 for order in orders.values()),
        'the error of q against the continuous scheme falls as T^p over the first segment, '
        'with p = ' + ', '.join(f'{order:.3f} ({name})' for name, order in orders.items()),
    )


def _seconds(
    controller: Controller | SecondOrderController, q: np.ndarray, dx: np.ndarray
) -> float:
    begun = time.perf_counter()
    controller.update(q, dx)
    return time.perf_counter() - begun


THEORETICAL = (
    Claim(
        '2.2 (14)',
        'Without redundancy, the sampled acceleration law is the velocity law J^-1 dx',
        square_task,
    ),
    Claim(
        '2.2',
        'The approximations (8) to (10) are consistent: '
        'the sampled laws tend to the continuous schemes',
        proportional,
    ),
    Claim(
        '3 (17)', 'Forms (15) and (17) of the law of least acceleration are identical', two_forms
    ),
    Claim(
        '4.2 (35)',
        'With the damping torque (34), law (32) becomes the simpler (35)',
        special_case_35,
    ),
    Claim(
        'A',
        'Every law is the minimum of its quadratic programme: (3), (24), (28), (A.1)',
        optimality,
    ),
    Claim(
        'B (B.2)',
        'Once the task has gone, the joints come to rest at q_0 + T dq_0 / (1 - lambda)',
        resting_place,
    ),
    Claim(
        'B',
        'k_d up to 1/T: no oscillation; up to 2/T: dies out oscillating; 2/T: for ever; '
        'beyond: diverges',
        regimes,
    ),
    Claim('7', 'The velocity laws cost no more computation than the second-order schemes', cost),
)
