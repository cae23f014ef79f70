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
        ddq_N: np.ndarray = -self.gain * offset / (len(offset) * width**2)
        return ddq_N


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
        ddq_N: np.ndarray = -self.gain * (state.q - target)
        return ddq_N

    def with_initial_targets(self, state: RobotState) -> Self:
        return replace(self, target=self.target or tuple(state.q.tolist()))
