"""The limits by name. A new limit is one small class and one line in this table."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

from redres_ros.errors import ArrayError, UnknownNameError
from redres_ros.limits.clearance import ClearanceLimit, CollisionLimit
from redres_ros.limits.joint import (
    AccelerationLimit,
    EndSpeedLimit,
    JerkLimit,
    PositionLimit,
    TorqueLimit,
    VelocityLimit,
)
from redres_ros.limits.limit import BoxLimit, Limit, RowLimit
from redres_ros.limits.limits import Bounds, Limits
from redres_ros.limits.workspace import WorkspaceLimit
from redres_ros.parameter import Table, check_once
from redres_ros.robot_model import RobotModel

LIMITS: Table[Limit] = Table(
    'limit',
    Limit,
    position=PositionLimit,
    velocity=VelocityLimit,
    acceleration=AccelerationLimit,
    jerk=JerkLimit,
    end_speed=EndSpeedLimit,
    collision=CollisionLimit,
    workspace=WorkspaceLimit,
    torque=TorqueLimit,
)
limit_name = LIMITS.name_of


def make_limits(
    names: Iterable[str | Limit],
    model: RobotModel,
    *,
    limit_scale: float = 1.0,
    torque_scale: float = 1.0,
    gains: Mapping[str, Any] = MappingProxyType({}),
) -> Limits:
    """The limits of those names, to be kept together.

    Args:
        names: of the table LIMITS; a limit that was made already is taken as it is.
        model: the arm, from which they have their figures.
        limit_scale: the fraction of its velocities and accelerations that is allowed.
        torque_scale: the fraction of its torques that is allowed.
        gains: as {'position.margin': 0.02}; those of limits that are not asked for do nothing.

    Raises:
        UnknownNameError: for a limit or a gain that does not exist.
        RangeError: for a gain or a scale outside its range.
        RepeatedNameError: for a limit that is named twice.
        ArrayError: for figures that the arm lacks, and for a limit of another arm.
    """
    names = tuple(names)
    check_once('limit', names)
    known = LIMITS.gain_keys
    for gain in gains:
        if gain not in known:
            raise UnknownNameError('gain of a limit', gain, known)
    scales = {'limit_scale': limit_scale, 'torque_scale': torque_scale}
    made = [_made(name, model, scales, gains) for name in names]
    return Limits(_with_the_acceleration_in_force(made))


def _made(
    name: str | Limit, model: RobotModel, scales: Mapping[str, float], gains: Mapping[str, Any]
) -> Limit:
    """The limit of that name; one that was made already is checked, and taken as it is."""
    if isinstance(name, Limit):
        _check_arm(name, model)
        return name
    scale = scales[LIMITS[name].scaled_by] if name in LIMITS else 1.0
    return LIMITS.resolve(name, gains, model, scale)


def _with_the_acceleration_in_force(limits: list[Limit]) -> list[Limit]:
    """The limits, where distances are kept by the acceleration that is in force, if any is."""
    in_force = [limit.A for limit in limits if isinstance(limit, AccelerationLimit)]
    if not in_force:
        return limits
    (A,) = in_force
    return [
        replace(limit, acceleration=tuple(A / limit.scale), acceleration_is_limited=True)
        if isinstance(limit, ClearanceLimit)
        else limit
        for limit in limits
    ]


def _check_arm(limit: Limit, model: RobotModel) -> None:
    """Raise ArrayError for a limit of other joints: its arrays would not fit."""
    if limit.model.joint_names != model.joint_names:
        raise ArrayError(
            f'limit {limit_name(limit)} is of the joints {", ".join(limit.model.joint_names)}; '
            f'expected {", ".join(model.joint_names)}'
        )


__all__ = [
    'LIMITS',
    'Bounds',
    'BoxLimit',
    'Limit',
    'Limits',
    'RowLimit',
    'limit_name',
    'make_limits',
]
