"""Reads and writes files that users name, YAML among them, with errors in one line."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from redres_ros.errors import FileError, reason_of

_GONE = Path(__file__).with_name('gone.yaml')


@contextmanager
def _attempting(what: str) -> Iterator[None]:
    """Raise FileError if the block fails, which does something, named in words, to a file."""
    try:
        yield
    except (OSError, ValueError) as error:  # ValueError: a path that no file can have
        raise FileError(f'cannot {what}: {reason_of(error)}') from None


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """For a block that writes a file, in a folder that is made if need be. Raises FileError."""
    with _attempting(f'write {path}'):
        path.parent.mkdir(parents=True, exist_ok=True)
        yield


def read_text(path: Path) -> str:
    """The UTF-8 text of a file. Raises FileError, also for a pipe or device, which may not end."""
    with _attempting(f'read {path}'):
        if path.exists() and not path.is_file():
            raise ValueError('it is no regular file')
        return path.read_text(encoding='utf-8')


def read_yaml(path: Path) -> Any:
    """The content of a file. Raises FileError."""
    import yaml.composer  # for files alone

    text = read_text(path)
    try:
        if not yaml.__with_libyaml__:
            return yaml.safe_load(text)

        class _Loader(yaml.composer.Composer, yaml.CSafeLoader):  # C's crashes on deep nesting
            def __init__(self) -> None:
                yaml.CSafeLoader.__init__(self, text)  # parses three times as fast
                yaml.composer.Composer.__init__(self)

        return _Loader().get_single_data()
    except (yaml.YAMLError, ValueError) as error:  # ValueError: a number too long
        raise FileError(f'{path} is not YAML: {reason_of(error)}') from None
    except RecursionError:
        raise FileError(f'{path} is nested too deeply') from None


def replacements(*owners: str) -> dict[str, str]:
    """What to write instead of each name that parameters, or a command's words, no longer have."""
    gone = read_yaml(_GONE)
    return {
        name: instead
        for owner in owners
        for instead, names in gone.get(owner, {}).items()
        for name in names.split()
    }
