"""Topics, services and parameters."""

from collections.abc import Iterator
from typing import Any

from sphinx.errors import ExtensionError

from extension.graph import Parameter, interfaces
from extension.markdown import code, plain, table
from extension.texts import ON_DEMAND, SERVICES, TOPICS


def topics() -> Iterator[str]:
    """The table of topics: who publishes and who subscribes."""
    graph = interfaces()
    types = {}
    for node in graph.values():
        types.update({topic: kind for topic, (kind, _) in node.published.items()})
        types.update(node.subscribed)
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
    shared = set.intersection(*({p.name for p in node.parameters} for node in graph.values()))
    name = 'controller' if of == 'every' else of
    rows = [
        _parameter(parameter)
        for parameter in graph[name].parameters
        if (parameter.name in shared) == (of == 'every')
    ]
    yield from table(('parameter', 'default', 'is', 'allowed', 'live'), rows)


def _parameter(parameter: Parameter) -> tuple[str, ...]:
    return (
        code(parameter.name),
        code(_shown(parameter.default)),
        plain(parameter.description),
        plain(parameter.allowed),
        'live' if parameter.live else '',
    )


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
    latched = any(node.published.get(topic, ('', False))[1] for node in interfaces().values())
    if latched:
        return '; *latched*'
    return '; *on demand*' if topic.startswith(ON_DEMAND) else ''


def _check_words(kind: str, words: dict[str, str], found: dict[str, str]) -> None:
    missing = sorted(found.keys() - words.keys())
    useless = sorted(words.keys() - found.keys())
    if missing or useless:
        raise ExtensionError(f'docs/extension/texts.py: {kind}s {missing} missing, {useless} gone')
