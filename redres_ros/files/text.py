"""Reads and writes files that users name, YAML among them, with errors in one line."""

import json
import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from redres_ros.errors import FileError, reason_of

_MOST_NODES = 100_000  # of a YAML file, every alias counted as what it stands for


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


def read_text(path: Path) -> str:
    """The content of a file, in UTF-8. Raises FileError, also for a pipe or a device: reading some
    has no end.
    """
    with attempting(f'read {path}'):
        if path.exists() and not path.is_file():
            raise ValueError('it is no regular file')
        return path.read_text(encoding='utf-8')


def read_yaml(path: Path) -> Any:
    """The content of a file. Raises FileError."""
    import yaml  # for files alone

    text = read_text(path)
    try:
        node = yaml.compose(text, yaml.SafeLoader)
        if node and _size(node, {}) > _MOST_NODES:
            raise yaml.YAMLError(f'its aliases stand for more than {_MOST_NODES} values')
        return yaml.safe_load(text)
    except (yaml.YAMLError, ValueError) as error:  # ValueError: a number too long
        raise FileError(f'{path} is not YAML: {reason_of(error)}') from None
    except RecursionError:
        raise FileError(f'{path} is nested too deeply') from None


def _size(node: Any, known: dict[int, float]) -> float:
    """Number of nodes, a shared one counted as often as it is used; infinite for one within itself.

    Known are the sizes of the nodes that were counted already, by their identity.
    """
    if isinstance(node.value, str):
        return 1.0
    if id(node) not in known:
        known[id(node)] = math.inf  # until it is counted: a node found here contains itself
        pairs = [item if isinstance(item, tuple) else (item,) for item in node.value]
        known[id(node)] = 1.0 + sum(_size(child, known) for pair in pairs for child in pair)
    return known[id(node)]


def _finite(value: Any) -> Any:
    """The content with None for NaN and infinity."""
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
