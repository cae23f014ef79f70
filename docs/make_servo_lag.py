"""Draws docs/servo_lag.png: the loop with a servo's lag and delay, measured and by the formulas.

Run it with: python docs/make_servo_lag.py. It takes a minute.
"""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from redres_ros import Controller, RobotModel, load_task
from redres_ros.controller import INTEGRATE_FROM
from redres_ros.errors import DivergedError
from redres_ros.planning.planner import Planner

T = 0.002  # [s]
GAIN = 10.0  # K_P of Eq. (37) [1/s]
BANDWIDTHS = (20.0, 50.0, 100.0, 200.0, 400.0)  # of the servos [rad/s]
DELAYS = (1, 5, 20)  # cycles
NOISE = 1e-5  # of the measurement, standard deviation [rad]
PUSHED = 0.005  # [m] from the point to hold
SETTLED = 2.0  # [s]
SEARCHED = 1.1  # factor from one gain to the next

MODEL = RobotModel.named('lwr4_paper')
TASK = load_task('window')


class Servo:
    """An arm whose joints follow references with the lag of a bandwidth, and a delay."""

    def __init__(self, q: np.ndarray, bandwidth: float, delay: int = 0) -> None:
        self.q = q  # (n,) [rad]
        self._step = -np.expm1(-bandwidth * T)  # exact for a reference that is held
        self._delayed = [q] * delay

    def advance(self, q_ref: np.ndarray) -> None:
        """A cycle with a new reference, (n,) [rad]."""
        self._delayed.append(q_ref)
        self.q = self.q + self._step * (self._delayed.pop(0) - self.q)


def main() -> None:
    """Measure and draw."""
    figure = Figure(figsize=(11.0, 4.2), layout='constrained')
    errors, accelerations, gains = figure.subplots(1, 3)
    for source, marker in zip(INTEGRATE_FROM, 'ox', strict=True):
        measured = [motion(source, bandwidth) for bandwidth in BANDWIDTHS]
        errors.loglog(BANDWIDTHS, [1e3 * error for error, _ in measured], marker, label=source)
        accelerations.loglog(BANDWIDTHS, [ddq for _, ddq in measured], marker, label=source)
        print(source, measured, flush=True)
    for formula, colour in ((lag, 'C0'), (creep, 'C1')):
        errors.loglog(BANDWIDTHS, [1e3 * formula(each) for each in BANDWIDTHS], colour, lw=0.8)
    errors.set(ylabel='largest task error [mm]')
    accelerations.set(ylabel='RMS of reference acceleration [rad/s²]')
    for delay, marker in zip(DELAYS, 'osx', strict=True):
        found = [largest_gain(bandwidth, delay) for bandwidth in BANDWIDTHS]
        bounds = [gain_bound(bandwidth, delay) for bandwidth in BANDWIDTHS]
        (line,) = gains.loglog(BANDWIDTHS, found, marker, label=f'{delay}')
        gains.loglog(BANDWIDTHS, bounds, color=line.get_color(), lw=0.8)
        print(delay, found, bounds, flush=True)
    gains.axhline(GAIN, color='0.6')
    gains.set(ylabel='largest stable $K_P$ [1/s]')
    for ax in (errors, accelerations, gains):
        ax.set(xlabel='bandwidth of the servos [rad/s]')
        ax.set_xticks(BANDWIDTHS, [f'{each:g}' for each in BANDWIDTHS])
        ax.minorticks_off()
        ax.grid(alpha=0.3)
        title = 'delay [cycles]' if ax is gains else 'integrated from'
        ax.legend(title=title, loc='lower center', bbox_to_anchor=(0.5, 1.0), ncols=3)
    figure.savefig(Path(__file__).with_name('servo_lag.png'), dpi=110)


def motion(source: str, bandwidth: float) -> tuple[float, float]:
    """Largest task error [m], and RMS of the reference's acceleration [rad/s^2].

    The error is of an exact measurement, the acceleration is of one with noise.

    Args:
        source: What a reference goes on from, one of INTEGRATE_FROM.
        bandwidth: Of the servos [rad/s].
    """
    exact, _ = followed(source, bandwidth, 0.0)
    _, ddq = followed(source, bandwidth, NOISE)
    return exact, ddq


def followed(source: str, bandwidth: float, noise: float) -> tuple[float, float]:
    """As `motion`, with a noise of the measurement [rad]."""
    random = np.random.default_rng(0)
    controller = Controller(MODEL, 'minimum_velocity', T, integrate_from=source)
    planner = Planner(TASK)
    servo = Servo(TASK.start, bandwidth)
    error = 0.0
    references = []
    for k in range(round(TASK.segment_time / T)):
        q = servo.q + noise * random.normal(size=MODEL.n)
        reference = planner.reference(MODEL.tip(q)[0], k * T)
        error = max(error, float(np.linalg.norm(reference.x_d - MODEL.tip(servo.q)[0])))
        references.append(controller.update(q, reference.dx).q_ref)
        servo.advance(references[-1])
    ddq = np.diff(references, 2, axis=0) / T**2
    return error, float(np.sqrt(np.mean(np.sum(ddq**2, axis=1))))


def lag(bandwidth: float) -> float:
    """Task error [m] where references go on from the last command: a / (w K_P).

    At a steady speed the feedback takes the whole lag away, so the error is that of the largest
    acceleration a on the first segment, 10/sqrt(3) times its length over its duration squared.

    Args:
        bandwidth: w, of the servos [rad/s].
    """
    A, B, *_ = TASK.waypoints
    acceleration = 10.0 / np.sqrt(3.0) * float(np.linalg.norm(B - A)) / TASK.segment_time**2
    return acceleration / (bandwidth * GAIN)


def creep(bandwidth: float) -> float:
    """Task error [m] in steady motion where references go on from the measurement.

    The arm executes the fraction 1 - exp(-w T) of each step, and the feedback asks for the rest.
    The speed is the largest one on the first segment, 15/8 of its mean.

    Args:
        bandwidth: w, of the servos [rad/s].
    """
    A, B, *_ = TASK.waypoints
    speed = 15.0 / 8.0 * float(np.linalg.norm(B - A)) / TASK.segment_time
    fraction = -np.expm1(-bandwidth * T)
    return speed * (1.0 / fraction - 1.0) / GAIN


def largest_gain(bandwidth: float, delay: int) -> float:
    """The largest K_P [1/s] with which an error dies out, sought from half the bound on.

    Args:
        bandwidth: Of the servos [rad/s].
        delay: Of references [cycles].
    """
    gain = 0.5 * gain_bound(bandwidth, delay)
    while is_stable(gain, bandwidth, delay):
        gain *= SEARCHED
    return gain / SEARCHED


def is_stable(gain: float, bandwidth: float, delay: int) -> bool:
    """Whether the error in holding a point is smaller in the second half than in the first.

    Args:
        gain: K_P [1/s].
        bandwidth: Of the servos [rad/s].
        delay: Of references [cycles].
    """
    controller = Controller(MODEL, 'minimum_velocity', T)
    servo = Servo(TASK.start, bandwidth, delay)
    x_d = MODEL.tip(TASK.start)[0] + np.array((0.0, 0.0, PUSHED))
    errors = []
    for _ in range(round(SETTLED / T)):
        error = x_d - MODEL.tip(servo.q)[0]
        errors.append(float(np.linalg.norm(error)))
        try:
            servo.advance(controller.update(servo.q, gain * error).q_ref)
        except DivergedError:
            return False
    middle = len(errors) // 2
    return max(errors[middle:]) < 0.9 * max(errors[:middle])


def gain_bound(bandwidth: float, delay: int) -> float:
    """The K_P [1/s] at which K_P e^(-D s) / (s (1 + s/w)) has the phase -pi at the gain 1.

    A reference is held for a cycle, which counts as half a cycle of delay more, and is computed
    from the state before.

    Args:
        bandwidth: w, of the servos [rad/s].
        delay: Of references [cycles].
    """
    D = (delay + 0.5) * T
    w = np.linspace(1e-3, np.pi / T, 200_000)
    phase = np.pi / 2.0 + np.arctan(w / bandwidth) + D * w
    crossing = w[np.argmax(phase >= np.pi)]
    return float(crossing * np.hypot(1.0, crossing / bandwidth))


if __name__ == '__main__':
    main()
