"""Preferences for the arm's shape: dexterity, and the height of the elbow."""

import math
from dataclasses import dataclass

import numpy as np

from redres_ros.parameter import param
from redres_ros.preferences.preference import Preference
from redres_ros.robot_model import RobotState

ROWS = {'position': 3, 'pose': 6}  # of the Jacobian that is to be far from singular


@dataclass(frozen=True)
class Manipulability(Preference):
    """Away from singularities: ddq_N = k d/dq sqrt(det(J J')).

    Where J is singular the measure is zero and has no gradient; ddq_N is then zero, too.
    """

    rows: str = param('position', "rows of J: the tip's position or pose", choices=tuple(ROWS))

    def acceleration(self, state: RobotState) -> np.ndarray:
        m = ROWS[self.rows]
        J = state.J[:m]
        s = np.linalg.svd(J, compute_uv=False)
        if s[-1] <= 1e-9 * s[0]:
            return np.zeros(len(state.q))
        J_pinv = np.linalg.solve(J.dot(J.T), J)  # (m, n), the transpose of J^#
        dJ = jacobian_derivatives(state.J)[:, :m]  # (n, m, n)
        gradient = float(np.prod(s)) * np.einsum('imj,mj->i', dJ, J_pinv)  # w tr(J^# dJ/dq_i)
        ddq_N: np.ndarray = self.gain * gradient
        return ddq_N


@dataclass(frozen=True)
class ElbowHeight(Preference):
    """A high elbow: ddq_N = k dz/dq; or one at a wanted height z*: ddq_N = -k (z - z*) dz/dq."""

    height: float = param(math.inf, 'z*, wanted height of the elbow [m]; inf: as high as may be')

    def acceleration(self, state: RobotState) -> np.ndarray:
        frame = state.model.elbow_frame
        slope = state.jacobian(frame)[2]  # (n,) dz/dq
        if math.isinf(self.height):
            pull = math.copysign(1.0, self.height)
        else:
            pull = self.height - float(state.pose(frame)[0][2])
        ddq_N: np.ndarray = self.gain * pull * slope
        return ddq_N


def jacobian_derivatives(J: np.ndarray) -> np.ndarray:
    """dJ/dq_i of a serial arm's Jacobian J (6, n), (n, 6, n), by the rows of J alone.

    With v_j and w_j the linear and angular columns: joint i turns or shifts all that comes after
    it, so dw_j/dq_i = w_i x w_j and dv_j/dq_i = w_i x v_j for i <= j, and w_j x v_i for i > j.
    """
    v = J[:3].T  # (n, 3)
    w = J[3:].T
    n = len(v)
    inner = np.tri(n, dtype=bool).T[:, :, None]  # (i, j): i <= j
    w_v = np.cross(w[:, None], v[None])  # (i, j, 3): w_i x v_j
    dv = np.where(inner, w_v, w_v.transpose(1, 0, 2))
    dw = np.where(inner, np.cross(w[:, None], w[None]), 0.0)
    return np.concatenate((dv, dw), axis=2).transpose(0, 2, 1)
