"""The gate: the last check of a reference before it is published.

Limits on dq do not bound what the robot gets: missed cycles, restarts, measurements and wrapped
angles all act on the reference. With p where the robot is by now and v its velocity, after the last
published reference and m cycles (Controller.bridged), a reference q_ref passes if

    q_min <= q_ref <= q_max,   |q_ref - p| <= V T,   |(q_ref - p)/T - v| <= A T

(outside the range: only towards it). Otherwise the arm brakes within A.
"""

from dataclasses import replace

import numpy as np

from redres_ros.command import Command
from redres_ros.controller import Controller
from redres_ros.kernels.boxes import admit


class Gate:
    """Checks commands against the references published before, which the controller knows."""

    def __init__(self, controller: Controller) -> None:
        self.count = 0  # references that it changed
        self.reason = ''  # why it changed the last one; empty if it did not
        self._controller = controller

    def admit(self, command: Command) -> Command:
        """The command to be published; the controller goes on from there."""
        controller = self._controller
        model = controller.model
        p, v = controller.before
        V, A = self._allowed()
        q_ref = np.empty(model.n)
        dq = np.empty(model.n)
        joint = admit(command.q_ref, p, v, controller.T, V, A, model.q_min, model.q_max, q_ref, dq)
        self.reason = ''
        if joint < 0:
            return command
        self.count += 1
        self.reason = self._reason(joint, float(command.q_ref[joint]))
        controller.correct(q_ref, dq)
        return replace(
            command, q_ref=q_ref.copy(), solution=replace(command.solution, dq=dq.copy())
        )

    def _allowed(self) -> tuple[np.ndarray, np.ndarray]:
        """V (n,) [rad/s] and A (n,) [rad/s^2]; infinite for a controller without limits."""
        model = self._controller.model
        limits = self._controller.policy.limits
        unlimited = (np.inf,) * model.n
        if limits is None:
            return np.array(unlimited), np.array(unlimited)
        if limits.acceleration is not None:
            return model.dq_max, limits.acceleration
        return model.dq_max, np.array(model.arm.acceleration_limit or unlimited)

    def _reason(self, joint: int, value: float) -> str:
        """The violation of a joint's reference [rad], as text."""
        controller = self._controller
        model = controller.model
        p, v = controller.before
        V, A = self._allowed()
        name = model.joint_names[joint]
        if not np.isfinite(value):
            return f'{name}: the reference is {value}; expected a finite one'
        if not model.q_min[joint] <= value <= model.q_max[joint]:
            return (
                f'{name}: the reference {value:.4g} rad is outside the range '
                f'{model.q_min[joint]:.4g} to {model.q_max[joint]:.4g}'
            )
        dq = (value - float(p[joint])) / controller.T
        if abs(dq) > V[joint]:
            return f'{name}: {abs(dq):.4g} rad/s; allowed: {V[joint]:.4g}'
        ddq = abs(dq - float(v[joint])) / controller.T
        if ddq > A[joint]:
            return f'{name}: {ddq:.4g} rad/s^2; allowed: {A[joint]:.4g}'
        return f'{name}: {abs(dq):.4g} rad/s is too fast to stop at the end of its range'
