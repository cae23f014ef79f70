"""The parameters of contact, declared once, and the damping that a contact needs."""

import math
from dataclasses import dataclass
from functools import partial
from typing import Self

import numpy as np

from redres_ros.errors import ArrayError, RangeError
from redres_ros.parameter import check_parameters, param

BASE = 'base'
TIP = 'tip'
GAINS = ('mass', 'damping', 'stiffness', 'force')  # a value for each direction
_live = partial(param, live=True)
_STABLE = 1.5  # [rad] of phase that delay and servo may take at the crossover frequency


@dataclass(frozen=True)
class AdmittanceSettings:
    """Mass, damping, stiffness and desired force for each direction; sensor; reactions.

    Arrays have 3 values for a task velocity of 3 rows, 6 for one of 6: three directions, and the
    rotations about them.

    Raises:
        RangeError: A value that is not allowed, or a direction without mass, damping and stiffness.
        ArrayError: Arrays of different or other lengths.
    """

    enabled: bool = _live(False, 'yield to the measured wrench')
    frame: str = _live(BASE, 'frame of the directions: base, tip or the name of a link')
    mass: tuple[float, ...] = _live(
        (0.0, 0.0, 0.0), 'M_d [kg], [kg m^2]; 0: pure damping', 0.0, 1e4
    )
    damping: tuple[float, ...] = _live(
        (1000.0, 1000.0, 1000.0), 'D_d [N s/m], [Nm s/rad]', 0.0, 1e6
    )
    stiffness: tuple[float, ...] = _live(
        (0.0, 0.0, 0.0), 'K_d [N/m], [Nm/rad]; 0: no return to the commanded path', 0.0, 1e6
    )
    force: tuple[float, ...] = _live(
        (0.0, 0.0, 0.0),
        'f_d, desired force and moment of the environment on the tip [N], [Nm]',
        -1e3,
        1e3,
    )
    force_limit: float = _live(
        100.0, 'force above which the tip retreats and the arm holds [N]', 1.0, 1e4
    )
    wrench_timeout: float = _live(
        0.05, 'age at which a wrench counts as stale and the arm holds [s]', 0.001, 10.0
    )
    sensor_range: float = _live(
        0.0, 'largest force or moment that the sensor measures; 0: any [N]', 0.0, 1e5
    )
    filter_time: float = _live(
        0.0, 'time constant of the first-order filter of the wrench [s]', 0.0, 1.0
    )
    payload_mass: float = _live(
        0.0, 'mass mounted beyond the force sensor; its weight is subtracted [kg]', 0.0, 100.0
    )
    payload_center: tuple[float, ...] = _live(
        (0.0, 0.0, 0.0), 'centre of that mass in the frame of the tip [m]', -2.0, 2.0
    )
    search_speed: float = _live(
        0.02, 'largest speed at which a contact is approached [m/s]', 1e-4, 0.5
    )
    search_distance: float = _live(
        0.05, 'distance after which an approach without contact ends [m]', 1e-3, 1.0
    )
    retreat_speed: float = _live(0.02, 'speed of a retreat [m/s]', 1e-4, 0.5)
    retreat_distance: float = _live(0.01, 'length of a retreat [m]', 0.0, 0.5)
    contact_stiffness: float = _live(
        0.0,
        'stiffness of environment and arm in series, for which a damping that is too low is '
        'refused; 0: unknown [N/m]',
        0.0,
        1e7,
    )
    contact_delay: int = _live(1, 'delay from a contact to the response [cycles]', 0, 1000)
    servo_bandwidth: float = _live(
        100.0, "natural frequency of the robot's position servos [rad/s]", 1.0, 1e4
    )

    def __post_init__(self) -> None:
        check_parameters(self)
        rows = len(self.damping)
        for name in GAINS:
            size = len(getattr(self, name))
            if size != rows or size not in (3, 6):
                raise ArrayError(f'{name} holds {size} values; expected 3 or 6, like damping')
        if len(self.payload_center) != 3:
            size = len(self.payload_center)
            raise ArrayError(f'payload_center holds {size} values; expected 3')
        for row in range(rows):
            if not self.mass[row] + self.damping[row] + self.stiffness[row] > 0.0:
                raise RangeError(
                    f'damping of direction {row + 1}', self.damping[row], 0.0, 1e6, 'not 0 alone'
                )

    @classmethod
    def of_rows(cls, rows: int) -> Self:
        """The defaults for a task velocity of 3 or 6 rows."""
        if rows == 3:
            return cls()
        none = (0.0,) * rows
        damping = (1000.0, 1000.0, 1000.0, 50.0, 50.0, 50.0)
        return cls(mass=none, damping=damping, stiffness=none, force=none)

    def check(self, rows: int, T: float) -> None:
        """Refuse settings that do not suit a task, or a contact.

        Args:
            rows: m of the task velocity.
            T: Sampling time [s].

        Raises:
            ArrayError: Arrays of another length than m.
            RangeError: A damping below the bound of the contact, or of the payload; the error
                names the bound.
        """
        if len(self.damping) != rows:
            raise ArrayError(
                f'damping holds {len(self.damping)} values; expected {rows}, as many as dx has'
            )
        contact = minimum_damping(
            self.contact_stiffness, T, delay=self.contact_delay, bandwidth=self.servo_bandwidth
        )
        for value, mass in zip(self.damping[:3], self.mass, strict=False):
            bound = max(contact, self._payload_bound(mass, T))
            if value < bound:
                raise RangeError('damping', value, math.ceil(bound), 1e6, 'N s/m')

    def _payload_bound(self, mass: float, T: float) -> float:
        """D_d below which the tip shakes by the payload's own inertia [N s/m], for M_d = mass [kg].

        The payload m acts on the sensor with -m times the acceleration. From one cycle to the next
        that is at most 2 m/T times the velocity, less by the filter; M_d resists it.
        """
        shown = self.payload_mass * T / (T + 2.0 * self.filter_time)
        return 2.0 * (shown - mass) / T


def minimum_damping(stiffness: float, T: float, *, delay: int = 1, bandwidth: float) -> float:
    """D_d below which the tip bounces [N s/m]: k (n T + 2/w) / 1.5.

    In contact the loop is an integrator of gain k/D_d behind a delay of n cycles and a servo, which
    is as late as 2/w. It is stable as long as these take less than 1.5 rad at the crossover.

    Args:
        stiffness: k of environment and arm in series [N/m].
        T: Sampling time [s].
        delay: n, from a contact to the response [cycles].
        bandwidth: w, natural frequency of the position servos [rad/s].
    """
    return stiffness * (delay * T + 2.0 / bandwidth) / _STABLE


def as_array(values: tuple[float, ...]) -> np.ndarray:
    """Values of each direction, (m,)."""
    return np.array(values, dtype=np.float64)
