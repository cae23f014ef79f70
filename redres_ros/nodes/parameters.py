"""Dataclass fields as ROS parameters: name, default, description and range are the field's."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from redres_ros.errors import RedresError, alike
from redres_ros.files.text import replacements
from redres_ros.loop.cycle_counter import RATES
from redres_ros.parameter import Parameter, check_value, param, parameters

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

P = TypeVar('P', bound='DataclassInstance')

NONE = 'none'  # the word for no limits and so on: ROS has no empty arrays


class ParameterError(RedresError):
    """A parameter of the wrong type, without a value, or that does not exist any more."""


@dataclass(frozen=True)
class LoopParameters:
    """Parameters of every node in the loop."""

    rate: float = param(500.0, 'cycles per second, the rate of joint_states [Hz]', *RATES)


@dataclass(frozen=True)
class ListenerParameters(LoopParameters):
    """Parameters of every node that listens to the robot."""

    base_frame: str = param(
        '', "frame of cartesian_velocity; empty: the root link of the arm's URDF"
    )
    task_space: str = param(
        'position', 'rows of the task: position 3, pose 6', choices=('position', 'pose')
    )


def declare(node: Node, defaults: P, prefix: str = '') -> P:
    """Declare every field of a dataclass that was made with `param`; returns the same with the
    node's values. Raises RedresError for one of another type, or that is not allowed.
    """
    values = {}
    for field, parameter in parameters(defaults).items():
        default = getattr(defaults, field.name)
        values[field.name] = declare_one(node, prefix + field.name, default, parameter)
    return replace(defaults, **values)


def declare_one(node: Node, name: str, default: Any, parameter: Parameter) -> Any:
    """Declare one parameter of the default's type; returns its value.

    Whole numbers are taken for numbers with a decimal point, a text with commas for an array of
    texts, and an empty array of texts for the word none, here and whenever the parameter is set.
    Raises RedresError for a value that is not allowed, ParameterException for one of another type.
    """
    initial = list(default) if isinstance(default, tuple) else default
    expected = RosParameter.Type.from_parameter_value(initial)
    given = node._parameter_overrides.get(name)
    if given is not None:
        given = _as_type(given, expected)
        node._parameter_overrides[name] = given
        if given.value is None:
            raise ParameterError(f'{name} is nothing; expected {expected.name}')
        if given.type_ is expected:
            check_value(name, _value(given), parameter)
    return _value(node.declare_parameter(name, initial, _descriptor(default, parameter)))


def on_live_change(
    node: Node, check: Callable[[dict[str, Any]], None], apply: Callable[[dict[str, Any]], None]
) -> None:
    """Have changes of parameters checked, all refused for a RedresError, and applied once set.

    Both functions get the changed values by name, tuples for arrays.
    """

    def _judge(changed: Iterable[RosParameter]) -> SetParametersResult:
        try:
            check(_values(changed))
        except RedresError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    node.add_on_set_parameters_callback(_judge)
    node.add_post_set_parameters_callback(lambda changed: apply(_values(changed)))


def with_changes(settings: P, changes: Mapping[str, Any], prefix: str = '') -> P:
    """A dataclass after changes of parameters by name; those of other parameters are ignored."""
    names = {prefix + field.name for field in fields(settings)}
    own = {name.removeprefix(prefix): changes[name] for name in names & changes.keys()}
    return replace(settings, **own)


def named(words: Iterable[str]) -> tuple[str, ...]:
    """The names in a parameter such as `limits`, without the word none."""
    return tuple(word for word in words if word != NONE)


def check_given(node: Node) -> None:
    """Raise ParameterError for a parameter of earlier versions; have values that are set live
    converted as by declare_one().
    """
    gone = replacements('parameters')
    for name in node._parameter_overrides.keys() & gone.keys():
        raise ParameterError(f'{name} is no parameter any more: {gone[name]}')
    node.add_pre_set_parameters_callback(
        lambda changed: [
            _as_type(each, node.get_parameter_or(each.name, each).type_) for each in changed
        ]
    )


def warn_of_misspelt(nodes: Sequence[Node]) -> None:
    """Log in one line which names that were set from outside no node has, and which they resemble.

    ROS ignores names that no node declares. A name unlike all of ours is meant for other nodes. All
    nodes of a process are given: what its command line sets goes to each of them.
    """
    known = {name for node in nodes for name in node.get_parameters_by_prefix('')}
    given = {name for node in nodes for name in node._parameter_overrides}
    meant = [
        f'{name} (is {nearest} meant?)'
        for name in sorted(given - known)
        for nearest in alike(name, known)
    ]
    if meant:
        nodes[0].get_logger().warning(f'no parameter {", ".join(meant)}; it changes nothing')


def _values(changed: Iterable[RosParameter]) -> dict[str, Any]:
    return {parameter.name: _value(parameter) for parameter in changed}


def _value(parameter: RosParameter) -> Any:
    return tuple(parameter.value) if _is_array(parameter) else parameter.value


def _is_array(parameter: RosParameter) -> bool:
    return parameter.type_.name.endswith('_ARRAY')


def _as_type(given: RosParameter, wanted: RosParameter.Type) -> RosParameter:
    types = RosParameter.Type
    value = given.value
    is_empty = value is None or (_is_array(given) and not value)  # a file's [], and a service's
    if is_empty and wanted is types.STRING_ARRAY:
        return RosParameter(given.name, types.STRING_ARRAY, [NONE])
    if given.type_ is types.INTEGER and wanted is types.DOUBLE:
        return RosParameter(given.name, types.DOUBLE, float(value))
    if given.type_ is types.INTEGER_ARRAY and wanted is types.DOUBLE_ARRAY:
        return RosParameter(given.name, types.DOUBLE_ARRAY, [float(number) for number in value])
    if given.type_ is types.STRING and wanted is types.STRING_ARRAY:
        return RosParameter(given.name, types.STRING_ARRAY, [w.strip() for w in value.split(',')])
    return given


def _descriptor(default: Any, parameter: Parameter) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(
        description=parameter.description, read_only=not parameter.live
    )
    if parameter.choices:
        descriptor.additional_constraints = 'one of: ' + ', '.join(parameter.choices)
    lower = parameter.lower
    upper = parameter.upper
    if lower is None or upper is None:
        return descriptor
    if isinstance(default, float):
        limits = FloatingPointRange(from_value=float(lower), to_value=float(upper))
        descriptor.floating_point_range = [limits]
    elif isinstance(default, int):
        descriptor.integer_range = [IntegerRange(from_value=lower, to_value=upper, step=1)]
    return descriptor
