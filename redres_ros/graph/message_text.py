"""Message definitions as text, so that a recording can be read without ROS."""

import importlib
import importlib.util
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from redres_ros.errors import RedresError

_RULE = 80 * '='
_WORDS = {'boolean': 'bool', 'octet': 'byte', 'float': 'float32', 'double': 'float64'}


class TypeTextError(RedresError):
    """A message type that is not installed or not supported."""


def find_type(name: str) -> Any:
    """The class of a type such as 'std_msgs/msg/String'. Raises TypeTextError."""
    package, _, rest = name.partition('/')
    kind = rest.rpartition('/')[2]
    try:
        if not _has_messages(package):
            raise ImportError(package)
        return getattr(importlib.import_module(f'{package}.msg'), kind)
    except (ImportError, AttributeError):
        raise TypeTextError(
            f'messages of type {name} cannot be read: {package} is not installed'
        ) from None


def _has_messages(package: str) -> bool:
    """Whether a package is one of messages: names come from the graph, and importing executes."""
    if not package.isidentifier():
        return False
    spec = importlib.util.find_spec(package)
    if spec is None or spec.submodule_search_locations is None:
        return False
    return any(Path(place, 'msg').is_dir() for place in spec.submodule_search_locations)


def name_of(kind: Any) -> str:
    """The name of a type, such as 'sensor_msgs/msg/JointState'."""
    package = kind.__module__.partition('.')[0]
    return f'{package}/msg/{kind.__name__}'


def definition_of(kind: Any) -> str:
    """The definition of a type: one field per line, followed by its component types.

    That is what the MCAP format calls ros2msg. Constants and comments of the type are left out.
    """
    parts = [_fields(kind)]
    known = {name_of(kind).replace('/msg/', '/')}
    waiting = list(_used(kind))
    while waiting:
        name = waiting.pop(0)
        if name in known:
            continue
        known.add(name)
        used = find_type(name)
        parts.append(f'{_RULE}\nMSG: {name}\n{_fields(used)}')
        waiting.extend(_used(used))
    return '\n'.join(parts)


def _fields(kind: Any) -> str:
    fields = kind.get_fields_and_field_types()
    return '\n'.join(f'{_as_ros(field_type)} {name}' for name, field_type in fields.items())


def _used(kind: Any) -> Iterator[str]:
    """Names of the component types of a type, such as 'std_msgs/Header'."""
    for field_type in kind.get_fields_and_field_types().values():
        yield from re.findall(r'\w+/\w+', field_type)


def _as_ros(field_type: str) -> str:
    """A type as .msg files write it: sequence<double, 3> is float64[<=3]."""
    sequence = re.fullmatch(r'sequence<(.+?)(?:, (\d+))?>', field_type)
    if sequence:
        element, most = sequence.groups()
        return f'{_as_ros(element)}[<={most}]' if most else f'{_as_ros(element)}[]'
    array = re.fullmatch(r'(.+)\[(\d+)\]', field_type)
    if array:
        return f'{_as_ros(array[1])}[{array[2]}]'
    bounded = re.fullmatch(r'(w?string)<(\d+)>', field_type)
    if bounded:
        return f'{bounded[1]}<={bounded[2]}'
    return _WORDS.get(field_type, field_type)
