"""Preferences for joint positions."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from redres_ros.errors import ArrayError
from redres_ros.parameter import param
from redres_ros.preferences.preference import Preference
from redres_ros.robot_model import RobotState


@dataclass(frozen=True)
class JointCentering(Preference):
    """The middle of the joint ranges: ddq_N = -k dH/dq.

    H = 1/(2n) sum ((q_i - m_i) / (q_max,i - q_min,i))^2, m the middles. A joint without limits has
    no middle and no part in it.
    """

    def acceleration(self, state: RobotState) -> np.ndarray:
        width = state.model.q_max - state.model.q_min  # (n,) [rad]
        lower = np.where(np.isfinite(width), state.model.q_min, state.q)
        offset = np.where(np.isfinite(width), state.q - lower - width / 2.0, 0.0)
        return -self.gain * offset / (len(offset) * width**2)


@dataclass(frozen=True)
class JointLimitAvoidance(Preference):
    """Away from the ends of the joint ranges, ahead of time: ddq_N = -k e.

    e is by how much q + t dq, where the joint will be after the horizon t, is beyond the margin
    before an end. So it acts on a joint that comes near an end, the earlier the faster it is, and
    on no other: in mid-range the law is left alone.
    """

    gain: float = param(40.0, 'k of the auxiliary acceleration [1/s^2]', 0.0, 1e4)
    margin: float = param(0.26, 'distance from the ends in which it acts at rest [rad]', 0.0, 3.0)
    horizon: float = param(0.5, 't, how far a motion is predicted [s]', 0.0, 5.0)

    def acceleration(self, state: RobotState) -> np.ndarray:
        predicted = state.q + self.horizon * state.dq_prev  # (n,) [rad]
        above = np.maximum(predicted - (state.model.q_max - self.margin), 0.0)
        below = np.maximum(state.model.q_min + self.margin - predicted, 0.0)
        return self.gain * (below - above)


@dataclass(frozen=True)
class Posture(Preference):
    """A posture q*: ddq_N = -k (q - q*)."""

    target: tuple[float, ...] = param((), 'q*, a value for each joint [rad]; none: the start')

    def acceleration(self, state: RobotState) -> np.ndarray:
        target = np.array(self.target)
        if target.shape != state.q.shape:
            raise ArrayError(
                f'target of posture holds {target.size} angles; expected {state.q.size}, '
                'one for each joint'
            )
        return -self.gain * (state.q - target)

    def with_initial_targets(self, state: RobotState) -> Self:
        return replace(self, target=self.target or tuple(state.q.tolist()))
