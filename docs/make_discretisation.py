"""Draws docs/discretisation.png: the paper's sampling beside Tustin's and an exact dJ dq.

Run it with: python docs/make_discretisation.py. It takes half a minute.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from redres_ros import RobotModel, load_task

PERIODS = (0.001, 0.002, 0.004, 0.008, 0.016)  # T [s]
FINE = 0.0005  # [s], of the continuous motion, by Runge and Kutta
DAMPING = 10.0  # k_d [1/s]
GAIN = 10.0  # K_P of Eq. (37) [1/s]

MODEL = RobotModel.named('lwr4_paper')
TASK = load_task('window')

Motion = tuple[np.ndarray, np.ndarray]  # q (ticks, n) [rad], and the task's error (ticks,) [m]


def main() -> None:
    """Measure and draw."""
    fine = continuous()
    figure = Figure(figsize=(9.0, 3.6), layout='constrained')
    joints, errors = figure.subplots(1, 2, sharex=True)
    for name, scheme in SCHEMES.items():
        found = [judged(scheme(T), fine, T) for T in PERIODS]
        milliseconds = [1e3 * T for T in PERIODS]
        joints.loglog(milliseconds, [away for away, _ in found], 'o-', label=name)
        errors.loglog(milliseconds, [1e3 * error for _, error in found], 'o-', label=name)
        print(name, [(f'{away:.2g} rad', f'{1e3 * error:.2g} mm') for away, error in found])
    joints.set(xlabel='T [ms]', ylabel='deviation from continuous motion [rad]')
    errors.set(xlabel='T [ms]', ylabel='largest task error [mm]')
    for ax in (joints, errors):
        ax.grid(alpha=0.3, which='both')
    joints.legend(fontsize='small')
    figure.savefig(Path(__file__).with_name('discretisation.png'), dpi=110)


def desired(t: float) -> np.ndarray:
    """x_d, dx_d and ddx_d of Eq. (36) at a time [s], (3, 3)."""
    index = min(int(t / TASK.segment_time), TASK.segments - 1)
    xi = min(t / TASK.segment_time - index, 1.0)
    begin = TASK.waypoints[index]
    way = TASK.waypoints[index + 1] - begin
    s = xi**3 * (10.0 + xi * (6.0 * xi - 15.0))
    ds = 30.0 * xi**2 * (1.0 - xi) ** 2 / TASK.segment_time
    dds = 60.0 * xi * (1.0 - xi) * (1.0 - 2.0 * xi) / TASK.segment_time**2
    return np.array((begin + s * way, ds * way, dds * way))


def acceleration(t: float, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
    """Least acceleration with null-space damping, (18), with an exact dJ dq, (n,) [rad/s^2].

    Args:
        t: Time [s].
        q: (n,) [rad].
        dq: (n,) [rad/s].
    """
    state = MODEL.state(q, dq)
    J = state.J[:3]
    x_d, dx_d, ddx_d = desired(t)
    ddx = ddx_d + 2.0 * GAIN * (dx_d - J @ dq) + GAIN**2 * (x_d - state.x)
    wanted = ddx - MODEL.velocity_product(q, dq)[:3]
    inverse = np.linalg.pinv(J)
    return inverse @ (wanted + DAMPING * J @ dq) - DAMPING * dq


def continuous() -> np.ndarray:
    """The motion without sampling, q (ticks, n) every FINE [s]."""
    q = TASK.start
    dq = np.zeros(len(q))
    motion = []
    for k in range(ticks(FINE)):
        motion.append(q)
        h = FINE / 2.0
        t = k * FINE
        a1 = acceleration(t, q, dq)
        a2 = acceleration(t + h, q + h * dq, dq + h * a1)
        a3 = acceleration(t + h, q + h * (dq + h * a1), dq + h * a2)
        a4 = acceleration(t + FINE, q + FINE * (dq + h * a2), dq + FINE * a3)
        q = q + FINE * dq + FINE**2 / 6.0 * (a1 + a2 + a3)
        dq = dq + FINE / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
    return np.array(motion)


def sampled(T: float, forgetting: float, step: Callable[..., np.ndarray]) -> Motion:
    """Eq. (23) with feedback (37).

    Args:
        T: Sampling time [s].
        forgetting: lambda.
        step: Of (dq_k, dq_{k-1}), the mean velocity until the next tick, (n,) [rad/s].
    """
    q = TASK.start
    dq = np.zeros(len(q))
    motion = []
    errors = []
    for k in range(ticks(T)):
        state = MODEL.state(q, dq)
        x_d, dx_d, _ = desired(k * T)
        e = x_d - state.x
        motion.append(q)
        errors.append(np.linalg.norm(e))
        J = state.J[:3]
        before = dq
        b = forgetting * before
        dq = b + np.linalg.pinv(J) @ (dx_d + GAIN * e - J @ b)
        q = q + T * step(dq, before)
    return np.array(motion), np.array(errors)


def first_order(T: float) -> Motion:
    """The paper's: lambda = 1 - k_d T, and q + T dq."""
    return sampled(T, 1.0 - DAMPING * T, lambda dq, _: dq)


def tustin(T: float) -> Motion:
    """The rule of trapezoids for the damping and for the position."""
    half = DAMPING * T / 2.0
    return sampled(T, (1.0 - half) / (1.0 + half), lambda dq, before: (dq + before) / 2.0)


def exact(T: float) -> Motion:
    """The acceleration with an exact dJ dq, integrated as the paper does, (8) and (9)."""
    q = TASK.start
    dq = np.zeros(len(q))
    motion = []
    errors = []
    for k in range(ticks(T)):
        motion.append(q)
        errors.append(np.linalg.norm(desired(k * T)[0] - MODEL.state(q, dq).x))
        dq = dq + T * acceleration(k * T, q, dq)
        q = q + T * dq
    return np.array(motion), np.array(errors)


SCHEMES = {'first order (23)': first_order, 'Tustin': tustin, 'exact dJ dq': exact}


def ticks(T: float) -> int:
    """Ticks of the whole task."""
    return int(TASK.segments * TASK.segment_time / T)


def judged(motion: Motion, fine: np.ndarray, T: float) -> tuple[float, float]:
    """Largest distance of the joints from the continuous motion [rad], and task error [m]."""
    q, errors = motion
    beside = fine[:: round(T / FINE)][: len(q)]
    return float(np.linalg.norm(q[: len(beside)] - beside, axis=1).max()), float(errors.max())


if __name__ == '__main__':
    main()
