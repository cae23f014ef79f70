"""The safety filter: the last check of a reference before it is published.

Limits on dq do not bound what the robot gets: missed cycles, restarts, measurements and wrapped
angles all act on the reference. With p where the robot is by now and v its velocity
(RobotInterface.bridged), a reference q_ref passes if

    q_min <= q_ref <= q_max,   |q_ref - p| <= V T,   |(q_ref - p)/T - v| <= A T

(outside the range: only towards it). Otherwise the arm brakes within A.
"""

from dataclasses import replace

import numpy as np

from redres_ros.controller import Controller, Plan
from redres_ros.kernels.boxes import admit
from redres_ros.types import JointAccelerations, JointVelocities


class SafetyFilter:
    """Checks plans against what the controller has published before."""

    def __init__(self, controller: Controller) -> None:
        self.count = 0  # references that it changed
        self.reason = ''  # why it changed the last one; empty if it did not
        self._controller = controller
        self._limits = controller.policy.limits
        self._V, self._A = self._allowed()

    def admit(self, plan: Plan) -> Plan:
        """The plan whose reference may be published."""
        model = self._controller.model
        T = self._controller.T
        base = plan.base
        if self._controller.policy.limits is not self._limits:
            self._limits = self._controller.policy.limits
            self._V, self._A = self._allowed()
        V = self._V
        A = self._A
        q_ref = np.empty(model.n)
        dq = np.empty(model.n)
        joint = admit(plan.q_ref, base.q, base.dq, T, V, A, model.q_min, model.q_max, q_ref, dq)
        self.reason = ''
        if joint < 0:
            return plan
        self.count += 1
        self.reason = self._reason(plan, joint, V, A)
        solution = replace(plan.solution, dq=dq)
        ddq = (dq - base.dq) / T
        return replace(plan, solution=solution, q_ref=q_ref, dq=dq, ddq=ddq)

    def _allowed(self) -> tuple[JointVelocities, JointAccelerations]:
        """V and A; infinite for a controller without limits."""
        model = self._controller.model
        unlimited = np.full(model.n, np.inf)
        if self._limits is None:
            return unlimited, unlimited
        if self._limits.acceleration is not None:
            return model.dq_max, self._limits.acceleration
        return model.dq_max, np.array(model.arm.acceleration_limit or unlimited)

    def _reason(self, plan: Plan, joint: int, V: JointVelocities, A: JointAccelerations) -> str:
        """The violation of a joint's reference."""
        model = self._controller.model
        T = self._controller.T
        name = model.joint_names[joint]
        value = float(plan.q_ref[joint])
        if not np.isfinite(value):
            return f'{name}: the reference is {value}; expected a finite one'
        if not model.q_min[joint] <= value <= model.q_max[joint]:
            return (
                f'{name}: the reference {value:.4g} rad is outside the range '
                f'{model.q_min[joint]:.4g} to {model.q_max[joint]:.4g}'
            )
        dq = (value - float(plan.base.q[joint])) / T
        if abs(dq) > V[joint]:
            return f'{name}: {abs(dq):.4g} rad/s; allowed: {V[joint]:.4g}'
        ddq = abs(dq - float(plan.base.dq[joint])) / T
        if ddq > A[joint]:
            return f'{name}: {ddq:.4g} rad/s^2; allowed: {A[joint]:.4g}'
        return f'{name}: {abs(dq):.4g} rad/s is too fast to stop at the end of its range'
