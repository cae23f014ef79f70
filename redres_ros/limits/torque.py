"""Torque limits, kept through a velocity command (the paper's Section 7)."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from redres_ros.constrained import Rows
from redres_ros.errors import ArrayError
from redres_ros.kernels.boxes import within
from redres_ros.limits.limit import ReferenceState, RowLimit


@dataclass(frozen=True, eq=False)
class TorqueLimit(RowLimit):
    """-tau_max <= M (dq - dq_prev) / T + n <= tau_max, Eq. (6) with Eq. (13).

    Raises:
        ArrayError: A joint has no effort limit above zero.
    """

    order = 1
    scaled_by = 'torque_scale'

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, tau in zip(self.model.joint_names, self.model.tau_max, strict=True):
            if not tau > 0.0:
                raise ArrayError(
                    f'joint {name} has the effort limit {tau:g} in its URDF; '
                    'the torque limit needs one above zero'
                )

    @cached_property
    def tau_max(self) -> np.ndarray:
        """The torque that is allowed, (n,) [Nm]."""
        return self.scale * self.model.tau_max

    def rows(self, state: ReferenceState, T: float) -> Rows:
        C = state.M / T  # (n, n)
        rest = state.n - C.dot(state.dq_prev)  # (n,), the torque that dq = 0 would take
        return C, -self.tau_max - rest, self.tau_max - rest

    def is_kept(self, dq: np.ndarray, state: ReferenceState, T: float) -> bool:
        ddq = (dq - state.dq_prev) / T  # Eq. (13)
        tau = self.model.torque(state.q, state.dq_prev, ddq)  # Eq. (6), without M or n
        return bool(within(tau, -self.tau_max, self.tau_max))
