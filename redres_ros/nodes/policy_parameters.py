"""Parameters of how the arm is to move: law, limits, preferences, tasks, their gains."""

from collections import ChainMap
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from itertools import chain
from typing import Any

from rclpy.node import Node

from redres_ros.laws import HORIZON, LAWS, law_name, look_ahead
from redres_ros.limits import LIMITS
from redres_ros.nodes.parameters import NONE, ParameterError, declare, declare_one, named
from redres_ros.parameter import Gain, param
from redres_ros.policy import Policy, make_policy
from redres_ros.preferences import PREFERENCES
from redres_ros.robot_model import RobotModel
from redres_ros.tasks import TASKS
from redres_ros.types import Seconds

# Nodes have limits on; a point out of reach is then to be a standstill, not a swinging arm.
END_OF_REACH = 0.02  # of the largest singular value of the task

_LOADED = (look_ahead,)  # compiled before the loop: a law that needs it may be set live
_NODES_OWN = {'horizon': HORIZON}  # defaults
_FIXED = {'acceleration.reach': END_OF_REACH}
_NONE: dict[str, Any] = {NONE: None}  # as a table, beside one that plugins may still add to
_SEVERAL = ('limits', 'preferences', 'secondary_tasks')  # parameters that are lists of names


@dataclass(frozen=True)
class _PolicySettings:
    law: str = param('minimum_acceleration', 'redundancy resolution law', choices=LAWS, live=True)
    limits: tuple[str, ...] = param(
        ('position', 'velocity', 'acceleration'),
        'limits that every command keeps',
        choices=ChainMap(_NONE, LIMITS),
        live=True,
    )
    limit_scale: float = param(
        1.0, 'fraction of the velocity and acceleration limits that is used', 0.001, 1.0, live=True
    )
    torque_scale: float = param(
        1.0, 'fraction of the torque limits that is used', 0.001, 1.0, live=True
    )
    preferences: tuple[str, ...] = param(
        (NONE,), 'objectives in the null space', choices=ChainMap(_NONE, PREFERENCES), live=True
    )
    secondary_tasks: tuple[str, ...] = param(
        (NONE,), 'further tasks in order of priority', choices=ChainMap(_NONE, TASKS), live=True
    )


class PolicyParameters:
    """The parameters of what a controller does in each tick, all of which can be set live."""

    def __init__(self, node: Node, model: RobotModel, task: str, T: Seconds) -> None:
        self._model = model
        self._task = task
        self._T = T
        self._values: dict[str, Any] = asdict(declare(node, _PolicySettings()))
        self._gains = _all_gains()
        for key, gain in self._gains.items():
            upper = 1.0 / T if key == 'damping' else gain.parameter.upper  # Appendix B
            parameter = replace(gain.parameter, upper=upper, live=True)
            default = _NODES_OWN.get(key, gain.default)
            self._values[key] = declare_one(node, key, default, parameter)
        self.policy = self._made(self._values)
        self._next = (self._values, self.policy)  # after a change that is allowed

    def check(self, changes: Mapping[str, Any]) -> None:
        """Make the policy after changes of parameters, for adopt(); those of others are ignored.

        Raises RedresError for a value that is not allowed, or that does not suit the arm.
        """
        values = {name: changes.get(name, value) for name, value in self._values.items()}
        is_same = values == self._values
        self._next = (values, self.policy if is_same else self._made(values))

    def adopt(self) -> Policy:
        """Put the policy that was checked last in force."""
        self._values, self.policy = self._next
        return self.policy

    @property
    def problem(self) -> str:
        """What is set but has no effect; empty if all has."""
        law = self.policy.law
        if self.policy.preferences and not law.has_memory:
            return f'preferences have no effect: {law_name(law)} does not know the last velocity'
        if not self._values['scene.walls'] or 'workspace' in self._values['limits']:
            return ''
        return 'walls are set but not kept: add workspace to the parameter limits'

    def _made(self, values: Mapping[str, Any]) -> Policy:
        for name in _SEVERAL:
            if NONE in values[name] and len(values[name]) > 1:
                raise ParameterError(f'{name} are {list(values[name])}; expected names or {NONE}')
        policy = make_policy(
            self._model,
            values['law'],
            task=self._task,
            limit_scale=values['limit_scale'],
            torque_scale=values['torque_scale'],
            limits=named(values['limits']),
            preferences=named(values['preferences']),
            secondary_tasks=named(values['secondary_tasks']),
            gains=_FIXED | {key: values[key] for key in self._gains},
        )
        policy.check(self._model, self._T)
        return policy


def _all_gains() -> dict[str, Gain]:
    """Every gain in the tables that is not fixed, by its key. Targets that are open by default are
    not among them: ROS has no value for that.
    """
    gains: dict[str, Gain] = {}
    for gain in chain.from_iterable(table.gains() for table in (LAWS, LIMITS, PREFERENCES, TASKS)):
        if gain.default != () and gain.key not in _FIXED:
            gains.setdefault(gain.key, gain)
    return gains
