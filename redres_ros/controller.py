"""The controller of Fig. 1: joint positions and a task velocity in, the next position reference
out, once a cycle.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from redres_ros.errors import RangeError, UnknownNameError
from redres_ros.laws import Law
from redres_ros.planner import quintic
from redres_ros.resolution import project, resolve
from redres_ros.robot_model import RobotModel, RobotState, finite_vector

INTEGRATE_FROM = ('command', 'measurement')


class Command(NamedTuple):
    """One tick's answer: dq (n,) [rad/s], q_ref (n,) [rad], and the state it answers.

    What only onlookers want is computed when asked for; find_null does it for `null`.
    """

    dq: np.ndarray
    q_ref: np.ndarray
    find_null: Callable[[], np.ndarray]
    state: RobotState
    T: float

    @property
    def null(self) -> np.ndarray:
        """What the law adds to the least motion for the task: the null-space term of Eq. (2), (n,)
        [rad/s].
        """
        return self.find_null()

    @property
    def ddq(self) -> np.ndarray:
        """Joint acceleration (dq_k - dq_{k-1}) / T, (n,) [rad/s^2], Eq. (13)."""
        return (self.dq - self.state.dq_prev) / self.T

    @property
    def tau(self) -> np.ndarray:
        """Joint torque M(q_k) ddq_k + n(q_k, dq_{k-1}), (n,) [Nm], Eq. (6)."""
        return self.state.M @ self.ddq + self.state.n

    @property
    def min_singular_value(self) -> float:
        """Smallest singular value of the task Jacobian."""
        return float(np.linalg.svd(self.state.J, compute_uv=False)[-1])


class Controller:
    """Turns task velocities into position references by the law in force, for one arm and one
    sampling time.

    model, law, T [s] as they say. switch_time [s]: over it a change of law is blended, as are
    starting and stopping; 0 switches at once. integrate_from: q_ref = q + T dq (footnote 1) with q
    the last 'command', so that a servo's lag does not make the arm creep, or the last
    'measurement'. Raises RangeError for T, switch_time or the law's damping.
    """

    def __init__(
        self,
        model: RobotModel,
        law: Law,
        T: float,
        *,
        switch_time: float = 0.0,
        integrate_from: str = 'command',
    ) -> None:
        if not 1e-5 <= T <= 1.0:
            raise RangeError('T', T, 1e-5, 1.0, 's')
        if not 0.0 <= switch_time <= 60.0:
            raise RangeError('switch_time', switch_time, 0.0, 60.0, 's')
        if integrate_from not in INTEGRATE_FROM:
            raise UnknownNameError('integrate_from', integrate_from, INTEGRATE_FROM)
        law.check_damping(T)
        self.model = model
        self.T = T
        self.switch_time = switch_time
        self._integrate_from = integrate_from
        self._law = law
        self._moving = True
        self.reset()

    @property
    def law(self) -> Law:
        """The law asked for last; a blend towards it may be under way."""
        return self._law

    @property
    def moving(self) -> bool:
        """Whether the law is followed (or being blended in); False after hold()."""
        return self._moving

    def switch_law(self, law: Law) -> None:
        """Go over to another law, or to the same one with other gains.

        Of several asked for during one blend the last one counts. Raises RangeError for a damping
        outside [0, 1/T]; the law in force then stays.
        """
        law.check_damping(self.T)
        self._law = law

    def hold(self) -> None:
        """Come to a standstill; the task is left."""
        self._moving = False

    def resume(self) -> None:
        """Follow the law again, from standing still."""
        self._moving = True

    def reset(self) -> None:
        """Forget the last command: the next update starts at the measured position, standing still."""
        self._q_ref: np.ndarray | None = None
        self._dq_prev = np.zeros(self.model.n)
        self._blend = _Blend(None, None, np.zeros(self.model.n), 1.0)

    def lag(self, q: np.ndarray) -> float:
        """Distance of the joint furthest behind from the last reference, for q (n,) [rad]; 0 before
        the first.
        """
        return 0.0 if self._q_ref is None else max(map(abs, (self._q_ref - q).tolist()))

    def update(self, q: np.ndarray, dx: np.ndarray, missed: int = 0) -> Command:
        """The command for the measured joint positions q (n,) [rad] and the task velocity dx (m,).

        dx: [m/s], and [rad/s] below it. missed: cycles since the last update that went without one;
        the arm is taken to have gone on with the last velocity. Raises ArrayError for a wrong
        shape, NaN or infinity, RangeError for missed; the controller is then as it was before.
        """
        if missed < 0:
            raise RangeError('missed', missed, 0, np.inf, 'cycles')
        q = finite_vector(q, self.model.n, 'q')
        dx = finite_vector(dx, self.model.m, 'dx')
        state = self.model.unchecked_state(q, self._dq_prev)
        blend = self._blend.advanced(
            self._law if self._moving else None, self._dq_prev, self.T, self.switch_time
        )
        dq, after = blend.resolve(state, dx, self.T)
        if self._q_ref is None or self._integrate_from == 'measurement':
            q_ref = q + self.T * dq  # footnote 1
        else:
            q_ref = self._q_ref + self.T * (missed * self._dq_prev + dq if missed else dq)
        self._q_ref = q_ref
        self._dq_prev = dq
        self._blend = after
        return Command(dq.copy(), q_ref.copy(), lambda: blend.project(state, self.T), state, self.T)


@dataclass(frozen=True)
class _Blend:
    """On the way from one law to another; None in the place of a law stands for standing still.

    dq_old: (n,) [rad/s] what the old law remembers as the last velocity: its own, or its null-space
    motion would fade by the mixture's share in every cycle. The new law remembers the mixture,
    which is what it takes over. share: of the switch time that is over; at 1 only the new law acts.
    """

    old: Law | None
    new: Law | None
    dq_old: np.ndarray
    share: float

    def advanced(
        self, wanted: Law | None, dq_prev: np.ndarray, T: float, switch_time: float
    ) -> '_Blend':
        """One cycle on; towards the wanted law once the last blend is over."""
        blend = self
        if self.share >= 1.0:
            if wanted is self.new or wanted == self.new:
                return self
            blend = _Blend(self.new, wanted, dq_prev, 0.0)
        return replace(
            blend, share=min(blend.share + (T / switch_time if switch_time > 0.0 else 1.0), 1.0)
        )

    def resolve(self, state: RobotState, dx: np.ndarray, T: float) -> tuple[np.ndarray, '_Blend']:
        """dq = (1 - s) dq_old + s dq_new: where both execute the task, J dq = dx, so does every
        mixture.
        """
        new = _resolve(self.new, state, dx, T)
        if self.share >= 1.0:
            return new, self
        old = _resolve(self.old, self._remembered(state), dx, T)
        return self._mixture(old, new), replace(self, dq_old=old)

    def project(self, state: RobotState, T: float) -> np.ndarray:
        """The null-space part of the same dq, (n,) [rad/s]."""
        new = _project(self.new, state, T)
        return (
            new
            if self.share >= 1.0
            else self._mixture(_project(self.old, self._remembered(state), T), new)
        )

    def _remembered(self, state: RobotState) -> RobotState:
        return state._replace(dq_prev=self.dq_old)

    def _mixture(self, old: np.ndarray, new: np.ndarray) -> np.ndarray:
        s, _ = quintic(self.share)
        return (1.0 - s) * old + s * new


def _resolve(law: Law | None, state: RobotState, dx: np.ndarray, T: float) -> np.ndarray:
    return (
        np.zeros(len(state.q))
        if law is None
        else resolve(state.J, dx, law.bias(state, T), law.weight(state))
    )


def _project(law: Law | None, state: RobotState, T: float) -> np.ndarray:
    return (
        np.zeros(len(state.q))
        if law is None
        else project(state.J, law.bias(state, T), law.weight(state))
    )
