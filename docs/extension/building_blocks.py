"""Laws, preferences, tasks, limits with their gains, and the arms."""

import inspect
from collections.abc import Iterator
from typing import Any

from extension.markdown import code, plain, table
from redres_ros.laws import LAWS
from redres_ros.limits import LIMITS
from redres_ros.parameter import Parameter, parameters
from redres_ros.preferences import PREFERENCES
from redres_ros.robots import ARMS
from redres_ros.tasks import TASKS

_HEADINGS = {'law': 'Laws', 'preference': 'Preferences', 'task': 'Tasks', 'limit': 'Limits'}


def building_blocks() -> Iterator[str]:
    """A table for each kind, then one of the arms."""
    for entries in (LAWS, PREFERENCES, TASKS, LIMITS):
        yield from (f'## {_HEADINGS[entries.kind]}', '')
        rows = [(code(name), plain(_says(cls)), _gains(cls)) for name, cls in entries.items()]
        yield from table(('name', 'is', 'gains'), rows)
    yield from ('## Arms', '')
    rows = [
        (code(name), str(len(arm.start)), code(arm.tip_frame), code(arm.task))
        for name, arm in ARMS.items()
    ]
    yield from table(('name', 'joints', 'tip', 'task'), rows)


def _says(cls: type) -> str:
    return ' '.join((inspect.getdoc(cls) or '').partition('\n\n')[0].split())


def _gains(cls: Any) -> str:
    return '; '.join(
        _gain(f.name, f.default, parameter) for f, parameter in parameters(cls).items()
    )


def _gain(name: str, default: Any, parameter: Parameter) -> str:
    """A gain with its default and range; a default of none says nothing."""
    shown = f' = {default:g}' if isinstance(default, float) else ''
    span = ''
    if parameter.lower is not None and parameter.upper is not None:
        span = f', {parameter.lower:g} to {parameter.upper:g}'
    return f'`{name}`{shown}: {plain(parameter.description)}{span}'
