"""Which limits act on a running arm."""

from dataclasses import dataclass

import numpy as np

from redres_ros.limits import Limit, Limits, limit_name
from redres_ros.nodes.controller_snapshot import ControllerSnapshot
from redres_ros.robot_model import RobotModel

_TOUCHING = 1e-6  # [rad/s] from a bound: what is commanded there, is commanded because of it


@dataclass(frozen=True)
class ActiveLimits:
    """The active limits of a command, for one arm and its limits.

    Args:
        model: The arm.
        limits: In force.
        period: Sampling time [s].
    """

    model: RobotModel
    limits: Limits
    period: float

    @np.errstate(
        over='ignore', invalid='ignore'
    )  # any node can publish a snapshot with absurd values
    def acting(self, snapshot: ControllerSnapshot) -> set[tuple[str, str]]:
        """The active limits: name, and the joint or pair of bodies."""
        state = self.model.state(snapshot.q_prev, snapshot.dq_prev)
        bounds = self.limits.at(state, self.period)
        touched: list[tuple[Limit, int]] = []
        for box_limit, box in zip(self.limits.box_limits, bounds.boxes[:-1], strict=True):
            touched += [(box_limit, joint) for joint in _touched(snapshot.dq, *box)]
        for row_limit, (C, low, high) in zip(self.limits.row_limits, bounds.rows, strict=True):
            touched += [(row_limit, row) for row in _touched(C @ snapshot.dq, low, high)]
        return {
            (limit_name(limit), limit.place(state, index, self.period)) for limit, index in touched
        }


def _touched(values: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> list[int]:
    """Indices of the values at or beyond one of their bounds."""
    margin = np.minimum(values - lower, upper - values)
    return np.flatnonzero(margin < _TOUCHING).tolist()
