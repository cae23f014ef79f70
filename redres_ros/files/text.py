"""Reads and writes files that users name: within limits of size, and with errors in one line."""

import os
import stat
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

from redres_ros.errors import FileError, reason_of


def read_file(path: Path, largest: int) -> bytes:
    """The content of a file.

    Args:
        path: Of a regular file; a pipe or a device may never end.
        largest: Size that is allowed [bytes].

    Raises:
        OSError: It cannot be opened.
        FileError: It is no regular file, or too large.
    """
    # Without O_NONBLOCK the opening of a pipe would wait for somebody who writes.
    with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK), 'rb') as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise FileError(f'{path} is no regular file')
        content = file.read(largest + 1)
    if len(content) > largest:
        raise FileError(f'{path} is too large; allowed: {largest} bytes')
    return content


@contextmanager
def attempting(what: str) -> Iterator[None]:
    """For a block that does something to a file, in words. Raises FileError where that fails."""
    try:
        yield
    except (OSError, ValueError) as error:  # ValueError: a path that no file can have
        raise FileError(f'cannot {what}: {reason_of(error)}') from None


def writing(path: Path) -> AbstractContextManager[None]:
    """For a block that writes a file. Raises FileError, which names it, where that fails."""
    return attempting(f'write {path}')
