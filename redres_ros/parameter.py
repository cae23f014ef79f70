"""Parameters as dataclass fields: default, meaning with unit, and range, declared once for ROS, CLI
and docs.
"""

import math
from collections.abc import Collection
from dataclasses import Field, dataclass, field, fields
from functools import cache
from numbers import Real
from typing import Any

from redres_ros.errors import RangeError, UnknownNameError

_KEY = 'parameter'


@dataclass(frozen=True)
class Parameter:
    """The declaration of a field beside its type and default."""

    description: str
    lower: float | None = None
    upper: float | None = None
    choices: Collection[str] = ()
    live: bool = False  # can be set while the node runs


def param(
    default: Any,
    description: str,
    lower: float | None = None,
    upper: float | None = None,
    *,
    choices: Collection[str] = (),
    live: bool = False,
) -> Any:
    """A dataclass field that is a parameter: of Python, of a node, and of the command line.

    Args:
        default: Its value unless another is given.
        description: What it is, with its unit in brackets.
        lower: Least number that is allowed.
        upper: Largest number that is allowed.
        choices: The words that are allowed.
        live: Whether a running node takes another value.
    """
    return field(
        default=default, metadata={_KEY: Parameter(description, lower, upper, choices, live)}
    )


def parameters(of: Any) -> dict[Field[Any], Parameter]:
    """The fields of a dataclass, or of an instance, that were declared with `param`."""
    return _declared(of if isinstance(of, type) else type(of))


@cache
def _declared(cls: Any) -> dict[Field[Any], Parameter]:
    return {f: f.metadata[_KEY] for f in fields(cls) if _KEY in f.metadata}


def check_parameters(instance: Any) -> None:
    """Raise RangeError or UnknownNameError for a value outside what its field allows; NaN is
    outside every range. A numpy scalar in a field becomes the Python number that it holds.
    """
    for f, parameter in parameters(instance).items():
        value = getattr(instance, f.name)
        check_value(f.name, value, parameter)
        if isinstance(value, Real) and hasattr(value, 'item'):
            object.__setattr__(instance, f.name, value.item())


def check_value(name: str, value: Any, parameter: Parameter) -> None:
    """The same for one value; of a tuple, every member has to lie within the range.

    Args:
        name: Name of the value in errors.
        value: A number, a text, or a tuple of either.
        parameter: What is allowed.

    Raises:
        RangeError: A number outside the range, or a value that is not a number.
        UnknownNameError: A text that is not among the choices.
    """
    members = value if isinstance(value, tuple) else (value,)
    for member in members:
        if parameter.choices:
            _check_choice(name, member, parameter.choices)
        else:
            _check_range(name, member, parameter)


def _check_choice(name: str, value: Any, choices: Collection[str]) -> None:
    if not isinstance(value, str) or value not in choices:
        raise UnknownNameError(name, value, choices)


def _check_range(name: str, value: Any, parameter: Parameter) -> None:
    lower = -math.inf if parameter.lower is None else parameter.lower
    upper = math.inf if parameter.upper is None else parameter.upper
    is_number = isinstance(value, Real)
    is_free_text = isinstance(value, str) and parameter.lower is parameter.upper is None
    if is_number and not lower <= value <= upper:
        raise RangeError(name, value, lower, upper)
    if not is_number and not is_free_text:
        raise RangeError(name, value, lower, upper, 'a number')
