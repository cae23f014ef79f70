"""Where numba keeps what it has compiled, and for how long.

A kernel contains the functions that it calls. numba itself looks only at the file in which a kernel
is written, so it would not notice a change of another one. Here it looks at all files of the room.
The places are its own: NUMBA_CACHE_DIR if that is set, else `__pycache__` beside the file, else a
folder of the user's where `__pycache__` cannot be written. Where that cannot be written either, as
in many a container, it is a folder below that for temporary files.
"""

import hashlib
import os
import stat
import tempfile
from functools import lru_cache
from pathlib import Path
from typing import Any

from numba.core import caching
from numba.core.runtime.nrt import rtsys

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
        try:
            return super().from_function(function, file)  # type: ignore[no-untyped-call]
        except OSError:
            return None  # the next one may do

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


class _AmongTemporaryFiles(_InTheHome):
    """For a home that cannot be written, either, or that there is not."""

    def __init__(self, function: Any, file: str) -> None:
        super().__init__(function, file)
        folder = own_folder(Path(tempfile.gettempdir()))
        name = self.get_suitable_cache_subpath(file)  # type: ignore[no-untyped-call]
        self._cache_path = str(folder / name)


def own_folder(parent: Path) -> Path:
    """A folder in which nobody but this user can put anything: what is in it gets executed.

    Args:
        parent: Where it is, or is to be.

    Raises:
        PermissionError: Somebody else made it, or could put another in its place.
        OSError: It cannot be made.
    """
    folder = parent / f'redres_ros-{os.getuid()}'
    folder.mkdir(mode=stat.S_IRWXU, exist_ok=True)
    found = folder.lstat()  # of a link itself, wherever it leads
    around = parent.stat()
    others = stat.S_IRWXG | stat.S_IRWXO
    written_by_others = around.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    if (
        not stat.S_ISDIR(found.st_mode)
        or found.st_uid != os.getuid()
        or found.st_mode & others
        or around.st_uid not in (0, os.getuid())
        or (written_by_others and not around.st_mode & stat.S_ISVTX)
    ):
        raise PermissionError(f'{folder} is not safe from others')
    return folder


class Kept(caching.FunctionCache):
    """What is kept of one function, loaded without setting up the compiler.

    numba would do that before it looks: 0.2 s, and 0.15 s for scipy.linalg, which its compiler
    loads. What has been compiled needs none of it, only that numba can count its references. Where
    nothing is kept the compiler sets itself up.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """What is kept for a signature, or None.

        Args:
            sig: The signature.
            target_context: numba's for this processor.
        """
        rtsys.initialize(target_context)
        return self._load_overload(sig, target_context)  # type: ignore[no-untyped-call]


def enter() -> None:
    """Put the places of this room before those that numba knows."""
    ours = [_WhereTheUserSays, _BesideTheSource, _InTheHome, _AmongTemporaryFiles]
    caching.CompileResultCacheImpl._locator_classes = ours + caching.CacheImpl._locator_classes
