"""Dataclass fields as ROS parameters: name, default, description and range are the field's."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from difflib import get_close_matches
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeVar

import yaml
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from redres_ros.errors import RedresError
from redres_ros.loop.cycle_counter import RATES
from redres_ros.parameter import Parameter, check_parameters, param, parameters

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

P = TypeVar('P', bound='DataclassInstance')

NONE = 'none'  # the word for no limits and so on: ROS has no empty arrays

_ALIKE = 0.85  # similarity of two names; target_timeout must not count as state_timeout


class ParameterError(RedresError):
    """A parameter of the wrong type, or without a value."""


def declare(node: Node, defaults: P, prefix: str = '') -> P:
    """Declare every field of a dataclass as a parameter.

    Args:
        node: Gets the parameters.
        defaults: A dataclass whose fields are made with `param`.
        prefix: What their names begin with, such as 'admittance.'.

    Returns:
        The same with the node's values.

    Raises:
        ParameterError: A value has another type.
        RangeError: A number is not allowed.
        UnknownNameError: A word is not allowed.
    """
    values = {}
    for field, parameter in parameters(defaults).items():
        default = getattr(defaults, field.name)
        values[field.name] = declare_one(node, prefix + field.name, default, parameter)
    declared = replace(defaults, **values)
    check_parameters(declared)
    return declared


def declare_one(node: Node, name: str, default: Any, parameter: Parameter) -> Any:
    """The value of a parameter that is declared here, a tuple for an array.

    A whole number is taken for one with a decimal point, a text with commas for an array of texts,
    and an empty array of texts for the word none, here and whenever the parameter is set.

    Args:
        node: Owner of the parameter.
        name: Name as users know it.
        default: Also says of what type it is.
        parameter: Description, range, choices, and whether it can be set live.

    Raises:
        ParameterError: A value of another type, none, or one out of range.
    """
    initial = list(default) if isinstance(default, tuple) else default
    of_any_type = ParameterDescriptor(dynamic_typing=True)
    given = node.declare_parameter(name, initial, of_any_type)
    node.undeclare_parameter(name)
    expected = RosParameter.Type.from_parameter_value(initial)
    wanted = _as_type(given, expected)
    if wanted.type_ is not expected:
        got = 'nothing' if given.value is None else repr(given.value)
        raise ParameterError(f'{name} is {got}; allowed: {_allowed(default, parameter)}')
    descriptor = _descriptor(default, parameter)
    try:
        value = node.declare_parameter(name, wanted.value, descriptor, ignore_override=True).value
    except ParameterException:
        allowed = _allowed(default, parameter)
        raise ParameterError(f'{name} is {wanted.value!r}; allowed: {allowed}') from None
    return tuple(value) if isinstance(default, tuple) else value


def on_live_change(
    node: Node, check: Callable[[dict[str, Any]], None], apply: Callable[[dict[str, Any]], None]
) -> None:
    """Have changes of parameters checked, all refused for a RedresError, and applied once set.

    Args:
        node: Owner of the parameters.
        check: Called with the changed values by name, tuples for arrays; raises if one is wrong.
        apply: Called with the same, once they are set.
    """

    def before(changed: list[RosParameter]) -> SetParametersResult:
        try:
            check(_values(changed))
        except RedresError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    node.add_pre_set_parameters_callback(lambda changed: [_as_declared(node, p) for p in changed])
    node.add_on_set_parameters_callback(before)
    node.add_post_set_parameters_callback(lambda changed: apply(_values(changed)))


def with_changes(settings: P, changes: Mapping[str, Any]) -> P:
    """A dataclass after changes of parameters; changes of other parameters are ignored.

    Args:
        settings: Before.
        changes: Values by name.
    """
    names = {field.name for field in fields(settings)}
    return replace(settings, **{name: changes[name] for name in names & changes.keys()})


def misspelt(nodes: Sequence[Node]) -> dict[str, str]:
    """Names that were set from outside and that no node has, with the names that they resemble.

    ROS ignores names that no node declares. A name unlike all of ours is meant for other nodes. All
    nodes of a process are given: what its command line sets goes to each of them.
    """
    known = {name for node in nodes for name in node.get_parameters_by_prefix('')}
    given = {name for node in nodes for name in node._parameter_overrides}
    found = {}
    for name in sorted(given - known):
        for nearest in get_close_matches(name, known, 1, _ALIKE):
            found[name] = nearest
    return found


def overruled(nodes: Sequence[Node], arguments: Sequence[str]) -> dict[str, str]:
    """What -p sets on a command line and a file of parameters sets otherwise, and which one counts.

    Below a key of /**, one that names the node, as /**/controller, counts more than -p.

    Args:
        nodes: All of the process.
        arguments: Arguments of the command line.
    """
    asked = dict(_assignments(arguments))
    counts = {}
    for node in nodes:
        for name in asked.keys() & node._parameter_overrides.keys():
            value = node._parameter_overrides[name].value
            if value is not None and value != asked[name]:  # ROS takes [] for no value
                counts[name] = f'-p has {asked[name]!r}, but a file has {value!r}, which counts'
    return counts


def _assignments(arguments: Sequence[str]) -> Iterator[tuple[str, Any]]:
    """Names and values that -p sets for all nodes of the process."""
    for option, word in pairwise(arguments):
        name, _, value = word.partition(':=')
        if option in ('-p', '--param') and value and ':' not in name:
            with suppress(yaml.YAMLError):
                yield name, yaml.safe_load(value)


def _values(changed: Iterable[RosParameter]) -> dict[str, Any]:
    return {p.name: tuple(p.value) if _is_array(p) else p.value for p in changed}


def _is_array(parameter: RosParameter) -> bool:
    return parameter.type_.name.endswith('_ARRAY')


def _as_declared(node: Node, given: RosParameter) -> RosParameter:
    """The value in the parameter's type, if the conversion is exact."""
    if not node.has_parameter(given.name):
        return given
    return _as_type(given, node.get_parameter(given.name).type_)


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
    state_timeout: float = param(
        0.1, 'time without joint_states after which the node reports an error [s]', 0.01, 10.0
    )


def _descriptor(default: Any, parameter: Parameter) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(
        description=parameter.description, read_only=not parameter.live
    )
    if parameter.choices:
        descriptor.additional_constraints = 'one of: ' + ', '.join(parameter.choices)
    if parameter.lower is None or parameter.upper is None:
        return descriptor
    if isinstance(default, float):
        lower = float(parameter.lower)
        upper = float(parameter.upper)
        descriptor.floating_point_range = [FloatingPointRange(from_value=lower, to_value=upper)]
    elif isinstance(default, int):
        lower = int(parameter.lower)
        upper = int(parameter.upper)
        descriptor.integer_range = [IntegerRange(from_value=lower, to_value=upper, step=1)]
    return descriptor


def _allowed(default: Any, parameter: Parameter) -> str:
    if parameter.choices:
        return ', '.join(parameter.choices)
    whole = isinstance(default, tuple) and isinstance(default[0], int)
    kinds = {
        bool: 'true or false',
        int: 'a whole number',
        float: 'a number with a decimal point',
        str: 'a text',
        tuple: 'an array of whole numbers' if whole else 'an array of numbers with decimal points',
    }
    limits = '' if parameter.lower is None else f' from {parameter.lower:g} to {parameter.upper:g}'
    example = list(default) if isinstance(default, tuple) else default
    return f'{kinds[type(default)]}{limits}, for example {example!r}'
