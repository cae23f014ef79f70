"""Limits of single joints: acceleration, velocity and position. Each is a box."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from redres_ros.bounded import Box
from redres_ros.errors import ArrayError
from redres_ros.limits.braking import stopping_box
from redres_ros.limits.limit import BoxLimit, ReferenceState
from redres_ros.parameter import param


@dataclass(frozen=True, eq=False)
class _Braking(BoxLimit):
    """What the limits that count on an acceleration share.

    Args:
        acceleration: (n,) [rad/s^2], for an arm whose table has none; empty for that table's.
    """

    acceleration: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        given = self.acceleration or self.model.arm.acceleration_limit
        if len(given) != self.model.n or not min(given) > 0.0:
            raise ArrayError(
                f'acceleration limits of {self.model.arm.urdf}: {given or "none known"}; '
                f'expected {self.model.n} positive values [rad/s^2] in acceleration=(...)'
            )

    @cached_property
    def A(self) -> np.ndarray:
        """The acceleration that is allowed, (n,) [rad/s^2]."""
        return self.scale * np.array(self.acceleration or self.model.arm.acceleration_limit)


@dataclass(frozen=True, eq=False)
class AccelerationLimit(_Braking):
    """|dq - dq_prev| <= A T. It holds whatever the state."""

    order = 0

    def box(self, state: ReferenceState, T: float) -> Box:
        reach = T * self.A  # (n,)
        return state.dq_prev - reach, state.dq_prev + reach


@dataclass(frozen=True, eq=False)
class VelocityLimit(BoxLimit):
    """|dq| <= V. A joint that is faster brakes as hard as it may."""

    order = 1

    @cached_property
    def V(self) -> np.ndarray:
        """The velocity that is allowed, (n,) [rad/s]."""
        return self.scale * self.model.dq_max

    @cached_property
    def _box(self) -> Box:
        return -self.V, self.V

    def box(self, state: ReferenceState, T: float) -> Box:
        return self._box


@dataclass(frozen=True, eq=False)
class PositionLimit(_Braking):
    """-beta(q - q_min) <= dq <= beta(q_max - q): the joint can always stop within its range.

    beta is the largest speed from which it stops in time if it brakes by A T a tick (braking.py). A
    joint that is outside comes back as fast as A allows, so that it stops at the end of its range.
    scale acts on A.

    Args:
        margin: [rad].
    """

    order = 2

    margin: float = param(
        float(np.radians(0.5)),
        'distance kept from the ends of the range [rad]',
        0.0,
        1.0,
        live=True,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (self.q_min < self.q_max).all():
            narrowest = float((self.model.q_max - self.model.q_min).min())
            raise ArrayError(
                f'a margin of {self.margin} rad leaves nothing of a range of {narrowest:.3g} rad; '
                f'allowed: less than {narrowest / 2.0:.3g}'
            )

    @cached_property
    def q_min(self) -> np.ndarray:
        """(n,) [rad], the margin taken off."""
        return self.model.q_min + self.margin

    @cached_property
    def q_max(self) -> np.ndarray:
        """(n,) [rad], the margin taken off."""
        return self.model.q_max - self.margin

    def box(self, state: ReferenceState, T: float) -> Box:
        return stopping_box(state.q, self.q_min, self.q_max, self.A, T)
