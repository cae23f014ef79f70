"""The limits by name. A new limit is one small class and one line in this table."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

from redres_ros.errors import ArrayError, UnknownNameError
from redres_ros.limits.distance import CollisionLimit, DistanceLimit, WorkspaceLimit
from redres_ros.limits.joint import (
    AccelerationLimit,
    EndSpeedLimit,
    JerkLimit,
    PositionLimit,
    TorqueLimit,
    VelocityLimit,
)
from redres_ros.limits.limit import JointLimit, Limit, ReferenceState
from redres_ros.limits.limits import Bounds, Limits
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


def make_limits(
    names: Iterable[str | Limit],
    model: RobotModel,
    *,
    limit_scale: float = 1.0,
    torque_scale: float = 1.0,
    gains: Mapping[str, Any] = MappingProxyType({}),
) -> Limits:
    """The limits of those names in LIMITS, to be kept together; limits themselves stay as they are.

    `limit_scale` is the fraction of the arm's velocities and accelerations that is allowed,
    `torque_scale` that of its torques. Gains are as {'position.margin': 0.02}; others do nothing.

    Raises UnknownNameError for a limit or a gain that does not exist, RangeError for a gain or a
    scale, RepeatedNameError, and ArrayError for values that the arm lacks or another arm's limit.
    """
    names = tuple(names)
    check_once('limit', names)
    known = LIMITS.gain_keys
    for gain in gains:
        if gain not in known:
            raise UnknownNameError('gain of a limit', gain, known)
    scales = {'limit_scale': limit_scale, 'torque_scale': torque_scale}
    made = [_made(name, model, scales, gains) for name in names]
    in_force = [limit.A for limit in made if isinstance(limit, AccelerationLimit)]
    for A in in_force:  # distances are kept by the acceleration that is in force
        made = [
            replace(limit, acceleration=tuple(A / limit.scale), acceleration_is_limited=True)
            if isinstance(limit, DistanceLimit)
            else limit
            for limit in made
        ]
    return Limits(model, {limit: LIMITS.name_of(limit) for limit in made})


def _made(
    name: str | Limit, model: RobotModel, scales: Mapping[str, float], gains: Mapping[str, Any]
) -> Limit:
    """The limit of that name; one that was made already is checked, and taken as it is."""
    if not isinstance(name, Limit):
        scale = scales[LIMITS[name].scaled_by] if name in LIMITS else 1.0
        return LIMITS.resolve(name, gains, model, scale)
    if name.model.joint_names != model.joint_names:  # its arrays would not fit
        raise ArrayError(
            f'limit {LIMITS.name_of(name)} is of the joints {", ".join(name.model.joint_names)}; '
            f'expected {", ".join(model.joint_names)}'
        )
    return name


__all__ = ['LIMITS', 'Bounds', 'JointLimit', 'Limit', 'Limits', 'ReferenceState', 'make_limits']
