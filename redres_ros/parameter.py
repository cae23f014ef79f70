"""Parameters as dataclass fields: default, meaning with unit, and range, declared once for ROS, CLI
and docs.
"""

import math
from dataclasses import Field, dataclass, field, fields
from typing import Any

from redres_ros.errors import RangeError, UnknownNameError

_KEY = 'parameter'


@dataclass(frozen=True)
class Parameter:
    """What a field says of itself beside its type and default."""

    description: str
    lower: float | None = None
    upper: float | None = None
    choices: tuple[str, ...] = ()
    live: bool = False  # can be set while the node runs


def param(
    default: Any,
    description: str,
    lower: float | None = None,
    upper: float | None = None,
    *,
    choices: tuple[str, ...] = (),
    live: bool = False,
) -> Any:
    """A dataclass field with a description (unit in brackets), an inclusive range or the allowed
    words.
    """
    return field(
        default=default, metadata={_KEY: Parameter(description, lower, upper, choices, live)}
    )


def parameters(of: Any) -> dict[Field, Parameter]:
    """The fields of a dataclass, or of an instance, that were declared with `param`."""
    return {f: f.metadata[_KEY] for f in fields(of) if _KEY in f.metadata}


def check_parameters(instance: Any) -> None:
    """Raise RangeError or UnknownNameError for a value outside what its field allows; NaN is
    outside every range.
    """
    for f, parameter in parameters(instance).items():
        check_value(f.name, getattr(instance, f.name), parameter)


def check_value(name: str, value: Any, parameter: Parameter) -> None:
    """The same for one value."""
    if parameter.choices and value not in parameter.choices:
        raise UnknownNameError(name, value, parameter.choices)
    lower = -math.inf if parameter.lower is None else parameter.lower
    upper = math.inf if parameter.upper is None else parameter.upper
    if isinstance(value, (int, float)):
        if not lower <= value <= upper:
            raise RangeError(name, value, lower, upper)
    elif not isinstance(value, (str, tuple)):
        raise RangeError(name, value, lower, upper, 'a number')
