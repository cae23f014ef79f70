"""What the arm is to do: a policy, made here from names and gains, and the crossfade to another."""

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from redres_ros.laws import LAWS, Law
from redres_ros.policy.crossfade import Crossfade, advanced
from redres_ros.policy.policy import SCALING, SPEED_LIMIT, Hold, Motion, Policy
from redres_ros.preferences import PREFERENCES, Preference
from redres_ros.robot_model import RobotModel
from redres_ros.table import as_tuple
from redres_ros.tasks import TASKS, Task

if TYPE_CHECKING:
    from redres_ros.limits import Limits
    from redres_ros.limits.limit import Limit


def make_policy(
    model: RobotModel,
    law: str | Law,
    *,
    task: str | Task = 'position',
    limits: 'Iterable[str | Limit]' = (),
    limit_scale: float = 1.0,
    torque_scale: float = 1.0,
    preferences: Iterable[str | Preference] = (),
    secondary_tasks: Iterable[str | Task] = (),
    scaling: str = 'task',
    gains: Mapping[str, Any] = MappingProxyType({}),
) -> Policy:
    """A policy from names and gains.

    Args:
        model: The arm.
        law: A name in LAWS, or a law.
        task: The first task: a name in TASKS, or a task.
        limits: Names in LIMITS, or limits.
        limit_scale: Factor on the arm's velocity and acceleration limits.
        torque_scale: Factor on its torque limits.
        preferences: Names in PREFERENCES, or preferences.
        secondary_tasks: Names in TASKS, or tasks, in order of priority.
        scaling: One of SCALING: what limits scale.
        gains: Gains of what is given by name: 'damping', 'posture.gain', 'position.margin'. Those
            of building blocks that are not in use do nothing.

    Raises:
        UnknownNameError: A name that is in no table.
        RangeError: A gain or a scale outside its range.
        RepeatedNameError: A limit, preference or task that is named twice.
        ArrayError: Limits that the arm has no figures for, a target that does not fit.
    """
    policy = Policy(
        LAWS.resolve(law, gains),
        TASKS.resolve(task),
        PREFERENCES.resolve_all(preferences, gains),
        TASKS.resolve_all(secondary_tasks, gains),
        _limits(model, limits, limit_scale, torque_scale, gains),
        scaling,
    )
    policy.check(model)
    return policy


def _limits(
    model: RobotModel,
    limits: 'Iterable[str | Limit]',
    limit_scale: float,
    torque_scale: float,
    gains: Mapping[str, Any],
) -> 'Limits | None':
    given = as_tuple(limits)
    others = gains.keys() - {*LAWS.gain_keys, *PREFERENCES.gain_keys, *TASKS.gain_keys}
    if not given and not others:
        return None
    from redres_ros.limits import LIMITS, make_limits  # compiled: loaded only if in use

    own = {key: gains[key] for key in gains.keys() & (others | LIMITS.gain_keys.keys())}
    made = make_limits(
        given, model, limit_scale=limit_scale, torque_scale=torque_scale, gains=own
    )  # refuses gains of nothing
    return made if given else None


__all__ = [
    'SCALING',
    'SPEED_LIMIT',
    'Crossfade',
    'Hold',
    'Motion',
    'Policy',
    'advanced',
    'make_policy',
]
