"""Output files, which are checked before a long computation begins."""

import os
from pathlib import Path

from redres_ros.errors import FileError


def made(directory: Path, *names: str) -> Path:
    """The directory, created if needed, and checked to be writable, with files of those names.
    Raises FileError.
    """
    from redres_ros.files.text import attempting

    with attempting(f'make the directory {directory}'):
        directory.mkdir(parents=True, exist_ok=True)
    if not os.access(directory, os.W_OK | os.X_OK):
        raise FileError(f'cannot write into {directory}: permission denied')
    for name in names:
        check_writable(directory / name)
    return directory


def pictures(out: Path, *names: str) -> list[Path]:
    """Where pictures of those names go: into a directory; or the first into a .pdf or .svg, the
    others beside it. Raises FileError if one of them cannot be written.
    """
    from redres_ros.simulation.drawing import DRAWINGS

    if out.suffix in DRAWINGS:
        files = [out, *(out.with_stem(f'{out.stem}_{name}') for name in names[1:])]
    else:
        files = [out / f'{name}.png' for name in names]
    made(files[0].parent, *(file.name for file in files))
    return files


def check_writable(path: Path) -> None:
    """Raise FileError if a file cannot be written; does not write it."""
    from redres_ros.files.text import attempting

    with attempting(f'write {path}'):
        if path.is_dir():
            raise FileError(f'cannot write {path}: Is a directory')
        existing = next(place for place in (path, *path.parents) if place.exists())
    if existing != path and not existing.is_dir():
        raise FileError(f'cannot write {path}: {existing} is not a directory')
    if not os.access(existing, os.W_OK):
        raise FileError(f'cannot write {path}: permission denied')
