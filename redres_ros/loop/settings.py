"""The parameters of CommandLoop."""

from dataclasses import dataclass
from typing import ClassVar

from redres_ros.parameter import check_parameters, param
from redres_ros.policy import SCALING

AUTO = 'auto'


@dataclass(frozen=True)
class LoopSettings:
    """When the controller follows, waits or holds, and how it buffers task velocities.

    Raises RangeError or UnknownNameError for a value that is not allowed.
    """

    command_timeout: float = param(
        0.1, 'age at which a cartesian_velocity counts as stale [s]', 0.001, 10.0, live=True
    )
    max_linear: float = param(
        2.0, 'largest linear task velocity; a faster one is refused [m/s]', 0.001, 100.0, live=True
    )
    max_angular: float = param(
        6.0, 'the same for the angular task velocity [rad/s]', 0.001, 100.0, live=True
    )
    twist_lag: int = param(
        1, 'cycles after its state at which a task velocity acts; in lock-step 0', 0, 100
    )
    scaling: str = param(
        AUTO,
        'what limits scale: the task velocity as a whole, or its components, translation and '
        'rotation; auto: the components of a velocity that is not computed from a state, as that '
        'of teleoperation',
        choices=(AUTO, *SCALING),
        live=True,
    )
    lockstep: bool = param(
        False, 'respond to a state only together with the cartesian_velocity of the same stamp'
    )

    # with which a sudden task velocity is approached
    max_linear_acceleration: ClassVar[float] = 2.0  # [m/s^2]
    max_angular_acceleration: ClassVar[float] = 6.0  # [rad/s^2]

    def __post_init__(self) -> None:
        check_parameters(self)
