"""Arm, task and limits of a graph, from its parameters."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from redres_ros.limits import Limit, Limits, gain_names, limit_name, make_limits
from redres_ros.nodes.controller_telemetry import ControllerSnapshot
from redres_ros.nodes.policy_parameters import named
from redres_ros.nodes.robot_parameters import TOPIC, MountingParameters
from redres_ros.planning.waypoints import load_task, task_for
from redres_ros.robot_model import RobotModel
from redres_ros.robots import arm_from_urdf, choose_arm

_TOUCHING = 1e-6  # [rad/s] from a bound: what is commanded there, is commanded because of it


@dataclass(frozen=True)
class ActiveLimits:
    """The active limits of a command, for one arm and its limits.

    Args:
        model: The arm.
        limits: In force.
        period: Sampling time [s].
    """

    model: RobotModel
    limits: Limits
    period: float

    # Any node can publish a snapshot with absurd values.
    @np.errstate(over='ignore', invalid='ignore')
    def acting(self, snapshot: ControllerSnapshot) -> set[tuple[str, str]]:
        """The active limits: name, and the joint or pair of bodies."""
        state = self.model.state(snapshot.q_prev, snapshot.dq_prev)
        bounds = self.limits.at(state, self.period)
        touched: list[tuple[Limit, int]] = []
        for box_limit, box in zip(self.limits.box_limits, bounds.boxes[:-1], strict=True):
            touched += [(box_limit, joint) for joint in _touched(snapshot.dq, *box)]
        for row_limit, (C, low, high) in zip(self.limits.row_limits, bounds.rows, strict=True):
            touched += [(row_limit, row) for row in _touched(C @ snapshot.dq, low, high)]
        return {
            (limit_name(limit), limit.place(state, index, self.period)) for limit, index in touched
        }


def _touched(values: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> list[int]:
    """Indices of the values at or beyond one of their bounds."""
    margin = np.minimum(values - lower, upper - values)
    return np.flatnonzero(margin < _TOUCHING).tolist()


Values = Mapping[str, Any]  # parameters of a node by name


def model_of(values: Values, description: str = '') -> RobotModel:
    """The arm that a controller has.

    Args:
        values: Of the controller.
        description: The URDF, for a controller that has it from a topic.

    Raises:
        RedresError: An arm that is not known here.
    """
    links = (values['tip_frame'], values['elbow_frame'])
    if values['robot'] == TOPIC:
        arm = arm_from_urdf(description, *links)
    else:
        arm = choose_arm(values['robot'], *links)
    mounting = {f.name: _unchangeable(values[f.name]) for f in fields(MountingParameters)}
    return RobotModel(MountingParameters(**mounting).mount(arm))


def points_of(planner: Values, model: RobotModel) -> np.ndarray:
    """The points of a planner's task, (P, 3) [m].

    Args:
        planner: The planner's parameters.
        model: Of the arm.

    Raises:
        RedresError: There is no such task.
    """
    name = planner['task']
    task = load_task(name) if name else task_for(model.arm, planner['robot'])
    return task.waypoints


def judge_of(values: Values, model: RobotModel) -> ActiveLimits:
    """The active limits of a controller with these parameters.

    Args:
        values: The controller's parameters.
        model: Of the arm.

    Raises:
        RedresError: A parameter has a value that cannot be.
    """
    limits = make_limits(
        named(values['limits']),
        model,
        limit_scale=values['limit_scale'],
        torque_scale=values['torque_scale'],
        gains={gain: _unchangeable(values[gain]) for gain in gain_names() if gain in values},
    )
    return ActiveLimits(model, limits, 1.0 / values['rate'])


def credible(changes: Values, known: Values) -> dict[str, Any]:
    """The changes that a node may have made: any participant can publish changes.

    Args:
        changes: Of parameters, as published.
        known: The parameters as they are, which says of what type each is.
    """
    return {
        name: value
        for name, value in changes.items()
        if name in known and type(value) is type(known[name])
    }


def _unchangeable(value: Any) -> Any:
    """A parameter's value, of an array as a tuple."""
    return value if isinstance(value, (bool, int, float, str)) else tuple(value)
