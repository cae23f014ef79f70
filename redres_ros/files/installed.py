"""Installed packages: their versions, and the entries that they add to our tables."""

import sys
import warnings
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

_OURS = b'[redres_ros.'  # how a group of ours begins in a declaration


def installed(kind: str) -> dict[str, Any]:
    """Name to class, of every entry point in the group redres_ros.KIND, such as 'laws'.

    A package declares one as `wrist_first = my_package.laws:WristFirst`. One that cannot be loaded
    is left out with a warning: the fault of another package must not stop an arm.
    """
    if not _any_declared():
        return {}
    from importlib.metadata import entry_points  # takes 0.1 s, and to look through all 0.2 s

    found = {}
    for entry in entry_points(group=f'redres_ros.{kind}'):
        try:
            found[entry.name] = entry.load()
        except Exception as error:  # noqa: BLE001  # whatever another package does
            reason = f'{type(error).__name__}: {error}'
            warnings.warn(f'{entry.name} of {entry.value} is left out: {reason}', stacklevel=2)
    return found


def version_of(package: str) -> str:
    """The version of a package; empty if it is not installed."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(package)
    except PackageNotFoundError:
        return ''


@cache
def _any_declared() -> bool:
    """Whether some package adds to our tables; takes some milliseconds."""
    return any(_OURS in file.read_bytes() for file in _declarations())


def _declarations() -> Iterator[Path]:
    """The files in which the packages that are installed declare their entry points."""
    for folder in sys.path:
        yield from Path(folder).glob('*-info/entry_points.txt')
