"""Topics, services and parameters."""

from collections.abc import Iterator
from typing import Any

from sphinx.errors import ExtensionError

from extension.graph import interfaces
from extension.markdown import code, plain, table
from extension.texts import ON_DEMAND, SERVICES, TOPICS


def topics() -> Iterator[str]:
    """The table of topics: who publishes and who subscribes."""
    graph = interfaces()
    types = {}
    for node in graph.values():
        types |= node.published | node.subscribed
    types.setdefault('forward_position_controller/commands', 'std_msgs/Float64MultiArray')
    _check_words('topic', TOPICS, types)
    rows = [
        (f'{code(topic)}<br>{types[topic]}', _direction(topic), words + _mark(topic))
        for topic, words in TOPICS.items()
    ]
    yield from table(('topic, type', 'from → to', 'is'), rows)


def services() -> Iterator[str]:
    """The table of services."""
    types = {}
    for node in interfaces().values():
        types.update(node.services)
    _check_words('service', SERVICES, types)
    rows = [(code(name), types[name], words) for name, words in SERVICES.items()]
    yield from table(('service', 'type', 'does'), rows)


def parameters(of: str) -> Iterator[str]:
    """The parameters of a node; of every node: those that all of them have."""
    graph = interfaces()
    shared = set.intersection(*(set(node.parameters) for node in graph.values()))
    rows = [
        (
            code(name),
            code(_shown(default)),
            plain(described.description),
            plain(_allowed(described)),
            '' if described.read_only else 'live',
        )
        for name, (default, described) in graph[
            of if of in graph else 'controller'
        ].parameters.items()
        if (name in shared) == (of == 'every')
    ]
    yield from table(('parameter', 'default', 'is', 'allowed', 'live'), rows)


def _allowed(described: Any) -> str:
    for span in (*described.floating_point_range, *described.integer_range):
        return f'{span.from_value:g} to {span.to_value:g}'
    return described.additional_constraints.removeprefix('one of: ')


def _shown(value: Any) -> str:
    if isinstance(value, float):
        return f'{value:g}' if value % 1.0 else f'{value:.1f}'
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (list, tuple)) or hasattr(value, 'tolist'):
        return f'[{", ".join(map(_shown, value))}]'
    return str(value)


def _direction(topic: str) -> str:
    """From which nodes to which; anyone where it is none of ours."""
    graph = interfaces().items()
    sources = [name for name, node in graph if topic in node.published]
    sinks = [name for name, node in graph if topic in node.subscribed]
    if topic.startswith('forward_position_controller'):
        sources = ['controller']  # only with robot_interface: ros2_control
    return f'{", ".join(sources) or "anyone"} → {", ".join(sinks) or "anyone"}'


def _mark(topic: str) -> str:
    if any(topic in node.latched for node in interfaces().values()):
        return '; *latched*'
    return '; *on demand*' if topic.startswith(ON_DEMAND) else ''


def _check_words(kind: str, words: dict[str, str], found: dict[str, str]) -> None:
    missing = sorted(found.keys() - words.keys())
    useless = sorted(words.keys() - found.keys())
    if missing or useless:
        raise ExtensionError(f'docs/extension/texts.py: {kind}s {missing} missing, {useless} gone')
