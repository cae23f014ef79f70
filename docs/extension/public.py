"""The public names of the package."""

import importlib
import inspect
from collections.abc import Iterator

import redres_ros


def public() -> Iterator[str]:
    """A section for each module that public names come from, with their documentation."""
    homes: dict[str, list[str]] = {}
    for name in redres_ros.__all__:
        homes.setdefault(redres_ros._HOMES[name], []).append(name)
    for home, names in homes.items():
        module = importlib.import_module(f'redres_ros.{home}')
        documented = [name for name in names if callable(getattr(module, name))]
        if documented:
            yield from (f'## {home}', '', _first_line(module), '')
        for name in documented:
            kind = 'autoclass' if inspect.isclass(getattr(module, name)) else 'autofunction'
            yield from ('```{eval-rst}', f'.. {kind}:: redres_ros.{home}.{name}', '```', '')


def _first_line(module: object) -> str:
    return ' '.join((inspect.getdoc(module) or '').partition('\n\n')[0].split())
