"""Claims of Sections 2 to 4 and of the appendices: identities, optimality, cost, damping."""

import time
from collections.abc import Iterator

import numpy as np

from redres_ros.command import norms
from redres_ros.controller import Controller
from redres_ros.laws import LAWS, make_law
from redres_ros.paper.claim import ROUNDING, Finding, claim, same_velocities
from redres_ros.paper.runs import (
    CONVERGING_LAWS,
    PREFERENCE,
    SIMULATION_DAMPING,
    SIMULATION_T,
    Runs,
)
from redres_ros.paper.second_order import SCHEMES, Scheme, SecondOrderController
from redres_ros.resolution import resolve, resolve_in_order
from redres_ros.robot_model import RobotModel, RobotState
from redres_ros.simulation.recording import Recording

_EVERY = 50  # ticks between the states of a run at which something is checked
_REPETITIONS = 3000  # of a tick when it is timed


@claim('2.2 (14)', 'Without redundancy, the sampled acceleration law is the velocity law J^-1 dx')
def _square_task(runs: Runs) -> Finding:
    """Six joints and six task variables, along a recorded motion."""
    T = SIMULATION_T
    model = RobotModel.named(runs.task.robot)
    recording = runs['simulated_23']
    third = len(recording.data) // 3
    worst = 0.0
    J_prev = np.zeros((6, 6))
    dq_prev = np.zeros(6)
    for q, dq in zip(recording.vectors('q1')[:third], recording.vectors('dq1'), strict=False):
        J = model.state(q, np.zeros(7)).J[:, :6]  # joint 7 stands still
        dx = J @ dq[:6]
        dx_prev = J_prev @ dq_prev
        ddq = np.linalg.solve(J, (dx - dx_prev) / T - (J - J_prev) / T @ dq_prev)  # Eq. (12)
        sampled = dq_prev + T * ddq  # Eq. (13)
        direct = np.linalg.solve(J, dx)  # Eq. (14)
        worst = max(worst, float(np.linalg.norm(sampled - direct)))
        J_prev = J
        dq_prev = dq[:6]
    return Finding(
        worst <= ROUNDING, f'largest difference {worst:.1e} rad/s over the first third of the task'
    )


@claim(
    '2.2',
    'The approximations (8) to (10) are consistent: '
    'the sampled laws tend to the continuous schemes',
)
def _proportional(runs: Runs) -> Finding:
    orders = {law: runs[f'convergence_{law}'] for law in CONVERGING_LAWS}
    return Finding(
        all(0.9 <= order <= 1.1 for order in orders.values()),
        'the error of q against the continuous scheme falls as T^p over the first segment, '
        'with p = ' + ', '.join(f'{order:.3f} ({name})' for name, order in orders.items()),
    )


@claim('3 (17)', 'Forms (15) and (17) of the law of least acceleration are identical')
def _two_forms(runs: Runs) -> Finding:
    differences = []
    for state, dq in _states(runs['simulated_15'], runs.model):
        J = state.J[:3]
        J_pinv = np.linalg.pinv(J)
        b = state.dq_prev
        form_15 = J_pinv @ (J @ dq) + (np.eye(len(b)) - J_pinv @ J) @ b
        form_17 = b + J_pinv @ (J @ dq - J @ b)
        differences.append(form_15 - form_17)
    return _identical(differences)


@claim(
    '3',
    'Near a singularity the task is deformed, but the change of the velocity is still minimised',
)
def _damped_variation(runs: Runs) -> Finding:
    random = np.random.default_rng(0)
    deformation = 0.0
    residual = 0.0
    for bend in np.geomspace(1e-2, 1e-4, 20):  # of elbow and wrist [rad]
        q = np.array((0.3, 0.5, 0.2, bend, 0.1, bend, 0.0))
        state = runs.model.state(q, random.uniform(-0.5, 0.5, 7))
        J = state.J[:3]
        dx = random.uniform(-0.1, 0.1, 3)
        dq = resolve(J, dx, state.dq_prev)
        deformation = max(deformation, float(np.linalg.norm(J @ dq - dx) / np.linalg.norm(dx)))
        change = dq - state.dq_prev
        residual = max(residual, float(np.linalg.norm(_null_space(J).T @ change)))
    return Finding(
        residual <= ROUNDING and deformation > 0.01,
        f'up to {deformation:.0%} of the task velocity is not executed; of all velocities that '
        f'execute the rest, the commanded one is {residual:.1e} rad/s from the least change',
    )


@claim(
    '3.1 (19)', 'Law (19) and scheme (18) give the same velocities with a preferred acceleration'
)
def _auxiliary_task(runs: Runs) -> Finding:
    return same_velocities(runs['difference_19'].max)


@claim(
    '3.1 (20)',
    'Law (20) executes several tasks in order of priority with the least change of the velocity',
)
def _several_tasks(runs: Runs) -> Finding:
    T = SIMULATION_T
    elbow = runs.model.elbow_frame
    dx_2 = np.array([0.05])  # [m/s]
    task_error = 0.0
    residual = 0.0
    difference = 0.0
    for state, moved in _states(runs['simulated_23'], runs.model):
        J_1 = state.J[:3]
        J_2 = state.jacobian(elbow)[2:3]
        dx_1 = J_1 @ moved
        b = state.dq_prev + T * PREFERENCE.acceleration(state)
        dq, _ = resolve_in_order([(J_1, dx_1), (J_2, dx_2)], b)
        J_1_pinv = np.linalg.pinv(J_1)
        P_1 = np.eye(len(b)) - J_1_pinv @ J_1
        lower_pinv = np.linalg.pinv(J_2 @ P_1)
        dq_l = J_1_pinv @ dx_1
        dq_l = dq_l + lower_pinv @ (dx_2 - J_2 @ dq_l)  # least velocity of both tasks
        P_l = P_1 - lower_pinv @ (J_2 @ P_1)
        J = np.vstack((J_1, J_2))
        task_error = max(task_error, float(np.abs(J @ dq - np.append(dx_1, dx_2)).max()))
        residual = max(residual, float(np.abs(_null_space(J).T @ (dq - b)).max()))
        difference = max(difference, float(np.linalg.norm(dq - (dq_l + P_l @ b))))  # Eq. (20)
    return Finding(
        max(task_error, residual, difference) <= ROUNDING,
        f'both tasks executed to {task_error:.1e} m/s, {difference:.1e} rad/s from (20) written '
        f'out, {residual:.1e} rad/s from the least change',
    )


@claim(
    '3.2',
    'A joint that the task does not need: least velocity stops it, least acceleration '
    'lets it drift at constant velocity, damping brings it to rest',
)
def _unneeded_joint(runs: Runs) -> Finding:
    T = SIMULATION_T
    first = 0.1  # [rad/s] of joint 7 before the first tick
    laws = {
        'least velocity': make_law('minimum_velocity'),
        'least acceleration': make_law('minimum_acceleration', damping=0.0),
        'with damping': make_law('minimum_acceleration', damping=SIMULATION_DAMPING),
    }
    recording = runs['simulated_23']
    q = recording.vectors('q1')
    moved = recording.vectors('dq1')
    ticks = round(1.0 / T)
    speeds = {}
    for name, law in laws.items():
        dq = np.append(np.zeros(6), first)
        for k in range(ticks):
            state = runs.model.state(q[k], dq)
            J = state.J[:3]
            dq = resolve(J, J @ moved[k], law.bias(state, T))
        speeds[name] = float(dq[6])
    expected = (0.0, first, first * (1.0 - SIMULATION_DAMPING * T) ** ticks)
    found = tuple(speeds.values())
    return Finding(
        bool(np.allclose(found, expected, rtol=0.0, atol=ROUNDING)),
        f'joint 7 turns at {first:g} rad/s; a second later at '
        + ', '.join(f'{speed:.2g} rad/s ({name})' for name, speed in speeds.items()),
    )


@claim('4.2 (35)', 'With the damping torque (34), law (32) becomes the simpler (35)')
def _special_case_35(runs: Runs) -> Finding:
    T = SIMULATION_T
    differences = []
    for state, dq in _states(runs['simulated_35'], runs.model):
        J = state.J[:3]
        Minv = np.linalg.inv(state.M)
        dx = J @ dq
        J_M = Minv @ J.T @ np.linalg.inv(J @ Minv @ J.T)  # Eq. (A.5)
        P_M = np.eye(len(dq)) - J_M @ J  # Eq. (33)
        tau_N = -state.M @ state.dq_prev / T  # Eq. (34)
        form_32 = J_M @ dx + P_M @ (state.dq_prev - T * Minv @ (state.n - tau_N))
        form_35 = J_M @ dx - T * P_M @ Minv @ state.n
        differences.append(form_32 - form_35)
    return _identical(differences)


@claim('7', 'The velocity laws cost no more computation than the second-order schemes')
def _cost(runs: Runs) -> Finding:
    ratios = {}
    state, moved = next(_states(runs['simulated_23'], runs.model, 1000))
    dx = state.J[:3] @ moved
    for name in SCHEMES:
        law = Controller(runs.model, make_law(name), SIMULATION_T)
        scheme = SecondOrderController(runs.model, Scheme(name), SIMULATION_T)
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


@claim('A', 'Every law is the minimum of its quadratic programme: (3), (24), (28), (A.1)')
def _optimality(runs: Runs) -> Finding:
    """Z' W (dq - b), Z spanning the null space of J, relative to its terms: zero at the constrained
    minimum.
    """
    worst = {}
    for name in LAWS:
        law = make_law(name)
        residuals = []
        for state, moved in _states(runs['simulated_23'], runs.model):
            b = law.bias(state, SIMULATION_T)
            W = law.weight(state)
            Z = _null_space(state.J[:3])
            dq = resolve(state.J[:3], state.J[:3] @ moved, b, W)
            W = np.eye(len(b)) if W is None else np.asarray(W)
            size = np.linalg.norm(W) * np.linalg.norm(dq - b)
            residuals.append(np.linalg.norm(Z.T @ W @ (dq - b)) / size)
        worst[name] = max(residuals)
    return Finding(
        bool(max(worst.values()) <= 1e-9),
        'largest relative residual ' + ', '.join(f'{name} {r:.0e}' for name, r in worst.items()),
    )


@claim('B (B.2)', 'Once the task has gone, the joints come to rest at q_0 + T dq_0 / (1 - lambda)')
def _resting_place(runs: Runs) -> Finding:
    T = SIMULATION_T
    first = np.linspace(-1.0, 1.0, 7)  # (n,) [rad/s]
    start = runs.task.start
    dq = first
    q = start
    law = make_law('minimum_acceleration', damping=SIMULATION_DAMPING)
    factor = law.forgetting_factor(T)  # lambda
    for _ in range(5000):
        q = q + T * dq
        dq = resolve(np.zeros((3, 7)), np.zeros(3), factor * dq)  # Eq. (B.1)
    miss = float(np.abs(q - (start + T * first / (1.0 - factor))).max())
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
    state = runs.model.state(runs.task.start, first)
    bias = make_law('minimum_acceleration', damping=1.0 / T).bias(state, T)
    dq = resolve(np.zeros((3, 7)), np.zeros(3), bias)
    speed = float(np.linalg.norm(first))
    return Finding(
        not dq.any(),
        f'from {speed:.2f} rad/s to {float(np.linalg.norm(dq)):g} rad/s in one step of '
        f'{1e3 * T:g} ms, which takes {float(np.linalg.norm(first - dq)) / T:.0f} rad/s^2',
    )


@claim('B', 'With k_d = 1/T the scheme of least acceleration becomes the law of least velocity')
def _full_damping(runs: Runs) -> Finding:
    return same_velocities(runs['difference_2'].max)


def _states(
    recording: Recording, model: RobotModel, every: int = _EVERY
) -> Iterator[tuple[RobotState, np.ndarray]]:
    """States along a recording, `every` tick apart, and the velocities commanded there."""
    q = recording.vectors('q1')
    dq = recording.vectors('dq1')
    for k in range(every, len(q), every):
        yield model.state(q[k], dq[k - 1]), dq[k]


def _identical(differences: list[np.ndarray]) -> Finding:
    """Whether two forms of a law differ by rounding only [rad/s]."""
    worst = norms(differences).max()
    return Finding(worst <= ROUNDING, f'largest difference {worst:.1e} rad/s')


def _null_space(J: np.ndarray) -> np.ndarray:
    """An orthonormal basis of the null space of J (m, n), which has full rank, (n, n - m)."""
    return np.linalg.svd(J)[2][len(J) :].T


def _seconds(
    controller: Controller | SecondOrderController, q: np.ndarray, dx: np.ndarray
) -> float:
    begun = time.perf_counter()
    controller.update(q, dx)
    return time.perf_counter() - begun


def _fate(ratio: float) -> str:
    """What becomes of a speed that is so many times the first one after a while."""
    if ratio < 1e-6:
        return 'dies out'
    return 'grows' if ratio > 1e6 else 'stays'
