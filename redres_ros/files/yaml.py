"""Reads YAML files within limits of size and depth."""

from pathlib import Path
from typing import Any

import yaml

from redres_ros.errors import FileError, reason_of
from redres_ros.files.text import attempting, read_file

_LARGEST = 200_000  # [bytes], some seconds of PyYAML's time
_MOST_NODES = 100_000  # every alias counted as what it stands for
_DEEPEST = 50  # lists within lists; PyYAML's time grows with the square of them


class _Loader(yaml.SafeLoader):
    """The loader of safe_load, which refuses documents larger or deeper than any of ours."""

    def fetch_flow_collection_start(self, TokenClass: Any) -> None:
        if self.flow_level >= _DEEPEST:
            raise RecursionError
        super().fetch_flow_collection_start(TokenClass)

    def get_single_node(self) -> yaml.Node | None:
        node = super().get_single_node()
        if node is not None and _size(node, {}) > _MOST_NODES:
            raise yaml.YAMLError(f'its aliases stand for more than {_MOST_NODES} values')
        return node


def read_yaml(path: Path) -> Any:
    """The content of a file. Raises FileError if it cannot be read, is too large, or is no
    YAML.
    """
    with attempting(f'read {path}'):
        text = read_file(path, _LARGEST)
    try:
        return yaml.load(text.decode(), _Loader)
    except RecursionError:
        raise FileError(f'{path} is nested too deeply') from None
    except (yaml.YAMLError, ValueError) as error:  # ValueError: not UTF-8, or a number too long
        raise FileError(f'{path} is not YAML: {reason_of(error)}') from None


def _size(node: yaml.Node, known: dict[int, float]) -> float:
    """Number of nodes, a shared one counted as often as it is used; infinite for one within itself.

    Known are the sizes of the nodes that were counted already, by their identity.
    """
    if id(node) not in known:
        known[id(node)] = float('inf')  # until it is counted: a node found here contains itself
        known[id(node)] = 1.0 + sum(_size(child, known) for child in _children(node))
    return known[id(node)]


def _children(node: yaml.Node) -> list[yaml.Node]:
    if isinstance(node, yaml.MappingNode):
        return [child for pair in node.value for child in pair]
    if isinstance(node, yaml.SequenceNode):
        return list(node.value)
    return []
