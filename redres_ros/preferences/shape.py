"""Preferences for the arm's shape: dexterity, and the height of the elbow."""

import math
from dataclasses import dataclass

import numpy as np

from redres_ros.parameter import param
from redres_ros.preferences.preference import Preference
from redres_ros.robot_model import RobotState

_FARTHEST = 1000.0  # [m] a height that no arm reaches; 1e308 times a gain would be infinite
_ROWS = {'position': 3, 'pose': 6}  # of the Jacobian that is to be far from singular


@dataclass(frozen=True)
class Manipulability(Preference):
    """Away from singularities: ddq_N = k d/dq sqrt(det(J J')).

    Where J is singular the measure is zero and has no gradient; ddq_N is then zero, too.
    """

    rows: str = param('position', "rows of J: the tip's position or pose", choices=tuple(_ROWS))

    def acceleration(self, state: RobotState) -> np.ndarray:
        m = _ROWS[self.rows]
        J = state.J[:m]
        s = np.linalg.svd(J, compute_uv=False)
        if s[-1] <= 1e-9 * s[0]:
            return np.zeros(len(state.q))
        J_pinv = np.linalg.solve(J.dot(J.T), J)  # (m, n), the transpose of J^#
        dJ = state.jacobian_derivatives('')[:, :m]  # (n, m, n)
        gradient = float(np.prod(s)) * np.einsum('imj,mj->i', dJ, J_pinv)  # w tr(J^# dJ/dq_i)
        return self.gain * gradient


@dataclass(frozen=True)
class ElbowHeight(Preference):
    """A high elbow: ddq_N = k dz/dq; or one at a desired height z*: ddq_N = -k (z - z*) dz/dq."""

    height: float = param(math.inf, 'z*, desired height of the elbow [m]; inf: as high as possible')

    def acceleration(self, state: RobotState) -> np.ndarray:
        frame = state.model.elbow_frame
        slope = state.jacobian(frame)[2]  # (n,) dz/dq
        if math.isinf(self.height):
            pull = math.copysign(1.0, self.height)
        else:
            pull = min(max(self.height, -_FARTHEST), _FARTHEST) - float(state.pose(frame)[0][2])
        return self.gain * pull * slope
