"""Reads files named by users, within limits of size and time."""

import os
import stat
from pathlib import Path

from redres_ros.errors import FileError


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
