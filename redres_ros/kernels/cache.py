"""Where numba keeps what it has compiled, and for how long.

A kernel contains the functions that it calls. numba itself looks only at the file in which a kernel
is written, so it would not notice a change of another one. Here it looks at all files of the room.
The places are its own: NUMBA_CACHE_DIR if that is set, else `__pycache__` beside the file, else a
folder of the user's where `__pycache__` cannot be written.
"""

import hashlib
from functools import lru_cache
from pathlib import Path
from typing import Any

from numba.core import caching

ROOM = Path(__file__).parent


@lru_cache
def stamp(folder: Path = ROOM) -> str:
    """A hash of all source files in a folder, by name and content."""
    found = hashlib.sha256()
    for path in sorted(folder.glob('*.py')):
        source = path.read_bytes()
        found.update(f'{path.name} {len(source)}\n'.encode())
        found.update(source)
    return found.hexdigest()


def _place(name: str) -> Any:
    """numba's class of that name, which older versions, as that of Ubuntu 24.04, call private."""
    return getattr(caching, name, None) or getattr(caching, f'_{name}')


class _OfTheRoom(caching._CacheLocator):
    """A place for what is compiled in this room, and for nothing else."""

    @classmethod
    def from_function(cls, function: Any, file: str) -> Any:
        if Path(file).parent != ROOM:
            return None
        return super().from_function(function, file)  # type: ignore[no-untyped-call]

    def get_source_stamp(self) -> str:
        return stamp()

    def get_disambiguator(self) -> str:
        """As in the names of files. numba's line number would leave a file for each of the past."""
        return 'kernel'


class _WhereTheUserSays(_OfTheRoom, _place('UserProvidedCacheLocator')):  # type: ignore[misc]
    pass


class _BesideTheSource(_OfTheRoom, _place('InTreeCacheLocator')):  # type: ignore[misc]
    pass


class _InTheHome(_OfTheRoom, _place('UserWideCacheLocator')):  # type: ignore[misc]
    pass


def enter() -> None:
    """Put the places of this room before those that numba knows."""
    ours = [_WhereTheUserSays, _BesideTheSource, _InTheHome]
    caching.CompileResultCacheImpl._locator_classes = ours + caching.CacheImpl._locator_classes
