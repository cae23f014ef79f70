"""Reads and writes files that users name: within limits of size, and with errors in one line."""

import json
import math
import os
import stat
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from redres_ros.errors import FileError, reason_of


def read_file(path: Path, largest: int) -> bytes:
    """The content of a regular file of an allowed size [bytes]; a pipe or a device may never end.

    Raises:
        OSError: It cannot be opened.
        FileError: It is not a regular file, or too large.
    """
    # Without O_NONBLOCK the opening of a pipe would wait for somebody who writes.
    with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK), 'rb') as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise FileError(f'{path} is not a regular file')
        content = file.read(largest + 1)
    if len(content) > largest:
        raise FileError(f'{path} is too large; allowed: {largest} bytes')
    return content


@contextmanager
def attempting(what: str) -> Iterator[None]:
    """Raise FileError if the block fails, which does something, named in words, to a file."""
    try:
        yield
    except (OSError, ValueError) as error:  # ValueError: a path that no file can have
        raise FileError(f'cannot {what}: {reason_of(error)}') from None


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """For a block that writes a file, in a folder that is made if need be. Raises FileError."""
    with attempting(f'write {path}'):
        path.parent.mkdir(parents=True, exist_ok=True)
        yield


def write_json(content: Mapping[str, object], path: Path) -> None:
    """Write values by name; null for NaN and infinity, which JSON does not know.

    Raises FileError.
    """
    with writing(path):
        path.write_text(json.dumps(_finite(content), indent=2) + '\n', encoding='utf-8')


def _finite(value: Any) -> Any:
    """The content with None for NaN and infinity."""
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
