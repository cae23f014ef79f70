"""Parameters as dataclass fields: default, meaning with unit, and range are declared once and read by ROS, the CLI and the docs."""

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


def param(default: Any, description: str, lower: float | None = None, upper: float | None = None, *,
          choices: tuple[str, ...] = (), live: bool = False) -> Any:
    """A dataclass field with a description (unit in brackets), an inclusive range or the allowed words."""
    return field(default=default, metadata={_KEY: Parameter(description, lower, upper, choices, live)})


def parameters(of: Any) -> dict[Field, Parameter]:
    """The fields of a dataclass, or of an instance, that were declared with `param`."""
    return {f: f.metadata[_KEY] for f in fields(of) if _KEY in f.metadata}


def check_parameters(instance: Any) -> None:
    """Raise RangeError or UnknownNameError for a value outside what its field allows; NaN is outside every range."""
    for f, parameter in parameters(instance).items():
        check_value(f.name, getattr(instance, f.name), parameter)


def check_value(name: str, value: Any, parameter: Parameter) -> None:
    """The same for one value."""
    if parameter.choices and value not in parameter.choices:
        raise UnknownNameError(name, value, parameter.choices)
    if parameter.lower is not None and not parameter.lower <= value <= parameter.upper:
        raise RangeError(name, value, parameter.lower, parameter.upper)
