"""The gate: the last check of a reference before it is published.

Limits on dq do not bound what the robot gets: missed cycles, restarts, measurements and wrapped
angles all act on the reference. With r the last published reference, v its velocity, and p where
the robot is by now after m cycles (controller.bridged), a reference q_ref passes if

    q_min <= q_ref <= q_max,   |q_ref - p| <= V T,   |(q_ref - p)/T - v| <= A T

(outside the range: only towards it). Otherwise the arm brakes within A.
"""

from typing import NamedTuple

import numpy as np

from redres_ros.controller import Controller, bridged
from redres_ros.kernels.boxes import admit


class Admission(NamedTuple):
    """The result of the gate for a reference.

    Attributes:
        q_ref: To be published, (n,) [rad].
        dq: Its velocity, (n,) [rad/s].
        reason: Why it is another one than was given; '' if it is that.
    """

    q_ref: np.ndarray
    dq: np.ndarray
    reason: str


class Gate:
    """Checks references against those published before.

    Args:
        controller: Knows the arm, the cycle and how the robot bridges missed cycles.
    """

    def __init__(self, controller: Controller) -> None:
        self.count = 0  # references that it changed
        self._controller = controller
        self.is_open = True  # nothing was published: the next reference may be anywhere
        self.q_ref = np.zeros(controller.model.n)  # published last, (n,) [rad]
        self.dq = np.zeros(controller.model.n)  # of that, (n,) [rad/s]
        self._before = (self.q_ref, self.dq)
        self._limits: object = None  # for which the figures hold
        self._figures: tuple[np.ndarray, np.ndarray] | None = None

    def clear(self) -> None:
        """Nothing was published: the next reference may be anywhere."""
        self.is_open = True
        self.dq = np.zeros(self._controller.model.n)

    def rollback(self) -> None:
        """The last reference came too late to be executed in a cycle of its own."""
        self.q_ref, self.dq = self._before

    def record(self, q_ref: np.ndarray) -> None:
        """A reference is published at rest, without a check: that of a mirroring arm."""
        self.is_open = False
        self.q_ref = q_ref
        self.dq = np.zeros(len(q_ref))
        self._before = (self.q_ref, self.dq)

    def admit(self, q_ref: np.ndarray, missed: int) -> Admission:
        """The reference to be published.

        Args:
            q_ref: The one that is proposed, (n,) [rad].
            missed: Cycles of the robot since the last one that went without a reference.
        """
        controller = self._controller
        model = controller.model
        T = controller.T
        if self.is_open:
            self.record(q_ref)
            return Admission(q_ref, self.dq, '')
        p = self.q_ref
        v = self.dq
        if missed:
            p, v = bridged(p, v, missed, controller)
        V, A = self._allowed()
        admitted = np.empty(len(q_ref))
        dq = np.empty(len(q_ref))
        joint = admit(q_ref, p, v, T, V, A, model.q_min, model.q_max, admitted, dq)
        self._before = (p, v)
        self.q_ref = admitted
        self.dq = dq
        if joint < 0:
            return Admission(admitted, dq, '')
        self.count += 1
        return Admission(admitted, dq, self._reason(joint, q_ref, p, v))

    def _allowed(self) -> tuple[np.ndarray, np.ndarray]:
        """V (n,) [rad/s] and A (n,) [rad/s^2]; infinite for a controller without limits."""
        limits = self._controller.policy.limits
        if limits is not self._limits or self._figures is None:
            self._limits = limits
            self._figures = _figures(self._controller)
        return self._figures

    def _reason(self, joint: int, q_ref: np.ndarray, p: np.ndarray, v: np.ndarray) -> str:
        """The violation of a reference, as text."""
        model = self._controller.model
        V, A = self._allowed()
        T = self._controller.T
        name = model.joint_names[joint]
        value = float(q_ref[joint])
        if not np.isfinite(value):
            return f'{name}: the reference is {value}; expected a finite one'
        if not model.q_min[joint] <= value <= model.q_max[joint]:
            return (
                f'{name}: the reference {value:.4g} rad is outside the range '
                f'{model.q_min[joint]:.4g} to {model.q_max[joint]:.4g}'
            )
        dq = (value - float(p[joint])) / T
        if abs(dq) > V[joint]:
            return f'{name}: {abs(dq):.4g} rad/s; allowed: {V[joint]:.4g}'
        ddq = abs(dq - float(v[joint])) / T
        if ddq > A[joint]:
            return f'{name}: {ddq:.4g} rad/s^2; allowed: {A[joint]:.4g}'
        return f'{name}: {abs(dq):.4g} rad/s is too fast to stop at the end of its range'


def _figures(controller: Controller) -> tuple[np.ndarray, np.ndarray]:
    model = controller.model
    limits = controller.policy.limits
    unlimited = np.full(model.n, np.inf)
    if limits is None:
        return unlimited, unlimited
    A = limits.acceleration
    if A is None and model.arm.acceleration_limit:
        A = np.array(model.arm.acceleration_limit)
    return model.dq_max, unlimited if A is None else A
