"""Parameters of the arm and of how it is to move: law, limits, preferences, tasks, their gains."""

import signal
from collections import ChainMap
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from itertools import chain
from typing import Any

import rclpy
from rclpy.node import Node
from std_msgs.msg import String

from redres_ros.files.processes import handled
from redres_ros.laws import HORIZON, LAWS, law_name, look_ahead
from redres_ros.limits import LIMITS
from redres_ros.nodes.parameters import NONE, ParameterError, declare, declare_one, named
from redres_ros.nodes.topics import LATCHED
from redres_ros.parameter import Gain, Parameter, param
from redres_ros.policy import Policy, make_policy
from redres_ros.preferences import PREFERENCES
from redres_ros.robot_model import RobotModel
from redres_ros.robots import Arm, arm_from_urdf, choose_arm
from redres_ros.robots.arm import ACCELERATIONS, DYNAMICS
from redres_ros.robots.joint_limits import with_accelerations
from redres_ros.tasks import TASKS
from redres_ros.types import Seconds

TOPIC = 'topic'  # in place of an arm's name: the URDF that another node publishes
DESCRIPTION = 'robot_description'
# Nodes have limits on; a point out of reach is then to be a standstill, not a swinging arm.
END_OF_REACH = 0.02  # of the largest singular value of the task

_PATIENCE = 3.0  # [s] of waiting for the description between one line in the log and the next
_WAIT = 0.1  # [s] after which Python's signal handlers have their turn
_ROBOT = Parameter(
    'arm: a name that `redres laws` prints, a path ending in .urdf, '
    'or topic: the URDF on robot_description'
)
_TIP_FRAME = Parameter(
    "link that carries out the task; empty: the arm's own, of a URDF the last one"
)
_ACCELERATION = Parameter('of each joint from base to tip [rad/s^2], or a file', *ACCELERATIONS)
_DYNAMICS = Parameter('inertias: identified arm or uniform cylinders', choices=DYNAMICS)
_LOADED = (look_ahead,)  # compiled before the loop: a law that needs it may be set live
_NODES_OWN = {'horizon': HORIZON}  # defaults
_FIXED = {'acceleration.reach': END_OF_REACH}
_NONE: dict[str, Any] = {NONE: None}  # as a table, beside one that plugins may still add to
_SEVERAL = ('limits', 'preferences', 'secondary_tasks')  # parameters that are lists of names


def declare_robot(
    node: Node, *, is_the_robot: bool = False, has_dynamics: bool = True
) -> tuple[str, Arm]:
    """Declare the parameters of the arm; returns what `robot` says, and the arm. With `topic`, wait
    until the description has come, unless the node is the robot and publishes it.

    Raises RedresError for an arm that cannot be used.
    """
    robot = declare_one(node, 'robot', 'lwr4_paper', _ROBOT)
    tip_frame = declare_one(node, 'tip_frame', '', _TIP_FRAME)
    if is_the_robot:
        arm = choose_arm(robot, tip_frame)
    else:
        arm = make_arm(robot, tip_frame, lambda: _await_description(node))
    given = node._parameter_overrides.get('acceleration_limit')
    if given is not None and isinstance(given.value, str):
        arm = with_accelerations(arm, given.value)
        del node._parameter_overrides['acceleration_limit']  # a parameter has one type
    acceleration = declare_one(node, 'acceleration_limit', arm.acceleration_limit, _ACCELERATION)
    arm = with_accelerations(arm, acceleration)
    for remark in arm.remarks():
        node.get_logger().info(remark)
    if has_dynamics:
        arm = replace(arm, dynamics=declare_one(node, 'dynamics', arm.dynamics, _DYNAMICS))
    arm.kinematics()  # refuses limits of another number of joints
    return robot, arm


def make_arm(robot: str, tip_frame: str, await_description: Callable[[], str]) -> Arm:
    """The arm of the parameters of those names; `topic` stands for the URDF that is waited for.
    Raises RedresError for one that cannot be used.
    """
    if robot == TOPIC:
        return arm_from_urdf(await_description(), tip_frame)
    return choose_arm(robot, tip_frame, others=(TOPIC,))


def _await_description(node: Node) -> str:
    """The URDF on robot_description, waited for as long as it takes; a signal ends the wait."""
    received: list[String] = []
    subscription = node.create_subscription(String, DESCRIPTION, received.append, LATCHED)
    waiting = f'waiting for a URDF on {subscription.topic_name}'
    # before the loop of the node looks at them
    with handled(signal.default_int_handler, signal.SIGINT, signal.SIGTERM):
        while not received:
            rclpy.spin_once(node, timeout_sec=_WAIT)
            node.get_logger().warning(waiting, throttle_duration_sec=_PATIENCE, skip_first=True)
    node.destroy_subscription(subscription)
    return str(received[-1].data)


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
