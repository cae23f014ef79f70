"""The difference of two experiments, for Figures 13 and 16."""

from dataclasses import dataclass

import numpy as np

from redres_ros.paper.experiment import Experiment
from redres_ros.paper.savgol import LEFT_OUT, differentiate


@dataclass(frozen=True)
class VelocityDifference:
    """Norms of differences of joint velocities, (N,) [rad/s], of a law (I) and a scheme (II).

    Args:
        t: (N,) [s].
        dq: Measured with the law, for scale.
        total: Commanded by the law, measured with the scheme: what the paper plots.
        measured: Measured with either.
        commanded: Commanded by either.
        filtered: Commanded by the scheme, before and after the filter that differentiates.
        servo: Commanded by the scheme and filtered in the same way, and measured: lag, speed limit
            and encoders.
    """

    t: np.ndarray
    dq: np.ndarray
    total: np.ndarray
    measured: np.ndarray
    commanded: np.ndarray
    filtered: np.ndarray
    servo: np.ndarray

    @classmethod
    def between(cls, law: Experiment, scheme: Experiment) -> 'VelocityDifference':
        """The difference of two experiments, while both were commanded.

        Args:
            law: The law's.
            scheme: The scheme's.
        """
        commands = [each.recording.vectors('dq1') for each in (law, scheme)]
        ticks = min(len(dq) for dq in commands)
        inner = slice(LEFT_OUT, ticks - LEFT_OUT)
        dq_I, dq_II = (dq[inner] for dq in commands)
        measured_I, measured_II = (each.motion.dq[: ticks - 2 * LEFT_OUT] for each in (law, scheme))
        smooth_II = _as_measured(scheme, ticks)
        return cls(
            law.motion.t[: len(dq_I)],
            _norm(measured_I),
            total=_norm(dq_I - measured_II),
            measured=_norm(measured_I - measured_II),
            commanded=_norm(dq_I - dq_II),
            filtered=_norm(dq_II - smooth_II),
            servo=_norm(smooth_II - measured_II),
        )


def _as_measured(tried: Experiment, ticks: int) -> np.ndarray:
    """The commanded velocities as the filter shows them, (N, n) [rad/s]."""
    T = tried.recording.T
    steps = T * tried.recording.vectors('dq1')[: ticks - 1]  # (ticks - 1, n) [rad]
    q = np.vstack((tried.q[:1], tried.q[0] + np.cumsum(steps, axis=0)))
    return differentiate(q, T).dq


def _norm(vectors: np.ndarray) -> np.ndarray:
    return np.linalg.norm(vectors, axis=1)
