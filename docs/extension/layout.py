"""The layers of the package, from the ground up, as the test of its imports has them."""

import ast
from collections.abc import Iterator
from pathlib import Path

from extension.markdown import code, plain, table

ROOT = Path(__file__).resolve().parents[2]


def layout() -> Iterator[str]:
    """A row for each module or subpackage: its layer, its name, and its docstring."""
    rows = [
        (str(number), code(name), plain(_says(name)))
        for number, layer in enumerate(_layers(), start=1)
        for name in sorted(layer)
    ]
    yield from table(('layer', 'module', 'holds'), rows)


def _layers() -> tuple[set[str], ...]:
    tree = ast.parse((ROOT / 'test' / 'test_layering.py').read_text(encoding='utf-8'))
    [value] = [
        node.value
        for node in tree.body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == 'LAYERS'
    ]
    layers: tuple[set[str], ...] = ast.literal_eval(value)
    return layers


def _says(name: str) -> str:
    """The first paragraph of a module's documentation, or of a package's."""
    folder = ROOT / 'redres_ros' / name
    file = folder / '__init__.py' if folder.is_dir() else folder.with_suffix('.py')
    said = ast.get_docstring(ast.parse(file.read_text(encoding='utf-8'))) or ''
    return ' '.join(said.partition('\n\n')[0].split())
