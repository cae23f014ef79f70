"""Your own laws, preferences, tasks and limits, from a file or entry points of a package."""

import importlib.util
import inspect
import re
import sys
import warnings
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

from redres_ros.errors import RedresError

# Base class and table of each kind. A file that defines a law has imported the laws, and so on.
_tables: dict[type, dict[str, type]] = {}
_loaded: dict[Path, tuple[str, ...]] = {}  # file -> names that it brought


class PluginError(RedresError):
    """A file that cannot be loaded, or defines no new class."""


def register(base: type, table: dict[str, type]) -> None:
    """Let plugins add subclasses of a base class to a table."""
    _tables[base] = table


def load_plugin(path: str | Path) -> tuple[str, ...]:
    """Add every law, preference, task and limit that a file defines to its table; their names:
    `WristFirst` becomes wrist_first. The file is executed as any program is, but only once.

    Raises PluginError for one that cannot be loaded, defines no such class, or whose name is taken.
    """
    file = Path(path).resolve()
    if file not in _loaded:
        _loaded[file] = _enter(_execute(file), file)
    return _loaded[file]


def installed(kind: str) -> dict[str, Any]:
    """Name to class, of every entry point in the group redres_ros.KIND, such as 'laws'.

    A package declares one as `wrist_first = my_package.laws:WristFirst`. One that cannot be loaded
    is left out with a warning: the fault of another package must not stop an arm.
    """
    found = {}
    for entry in entry_points(group=f'redres_ros.{kind}'):
        try:
            found[entry.name] = entry.load()
        except Exception as error:  # noqa: BLE001  # whatever another package does
            reason = f'{type(error).__name__}: {error}'
            warnings.warn(f'{entry.name} of {entry.value} is left out: {reason}', stacklevel=2)
    return found


def _execute(file: Path) -> ModuleType:
    name = f'redres_plugin_{file.stem}'
    spec = importlib.util.spec_from_file_location(name, file)
    if file.suffix != '.py' or not file.is_file() or spec is None or spec.loader is None:
        raise PluginError(f'{file} is not a plugin; expected an existing Python file')
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look their module up
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:  # whatever the file does
        del sys.modules[name]
        raise PluginError(f'{file} cannot be loaded: {type(error).__name__}: {error}') from error
    return module


def _enter(module: ModuleType, file: Path) -> tuple[str, ...]:
    found: list[tuple[str, type, dict[str, type]]] = []
    for name, cls in vars(module).items():
        own = inspect.isclass(cls) and cls.__module__ == module.__name__
        if own and not name.startswith('_') and not inspect.isabstract(cls):
            entry = re.sub(r'(?<=[a-z0-9])(?=[A-Z])', '_', name).lower()
            tables = (table for base, table in _tables.items() if issubclass(cls, base))
            found += [(entry, cls, table) for table in tables]
    if not found:
        raise PluginError(f'{file} defines no law, preference, task or limit')
    if taken := [name for name, _, table in found if name in table]:
        raise PluginError(f'{file} defines {taken[0]}, which exists already')
    for name, cls, table in found:
        table[name] = cls
    return tuple(name for name, _, _ in found)
