"""One statement, one idea: what no linter sees."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / 'redres_ros'
COMPREHENSIONS = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)
Kinds = type[ast.AST] | tuple[type[ast.AST], ...]


def nodes(source: str, kinds: Kinds) -> Iterator[ast.AST]:
    """Those of some kinds."""
    return (node for node in ast.walk(ast.parse(source)) if isinstance(node, kinds))


def is_packed(node: ast.Assign) -> bool:
    """Whether several values are assigned at once, as in a, b = x, y."""
    return isinstance(node.targets[0], ast.Tuple) and isinstance(node.value, ast.Tuple)


def holds_another(node: ast.AST, kinds: Kinds) -> bool:
    """Whether one of its kinds stands inside it."""
    return any(isinstance(inner, kinds) for inner in ast.walk(node) if inner is not node)


def faults(source: str) -> list[int]:
    """Lines with more than one idea."""
    found = [node for node in nodes(source, ast.Assign) if is_packed(node)]
    for kinds in (COMPREHENSIONS, ast.IfExp):
        found += [node for node in nodes(source, kinds) if holds_another(node, kinds)]
    return [node.lineno for node in found]


@pytest.mark.parametrize(
    'source', ['a, b = 1, 2', '[[i for i in row] for row in rows]', 'x if p else y if q else z']
)
def test_lines_with_two_ideas_are_found(source: str) -> None:
    assert faults(source) == [1]
    assert faults('a, b = pair()\n[i for row in rows for i in row]\nx if p else y') == []


def test_every_line_of_the_package_holds_one_idea() -> None:
    found = {
        str(path.relative_to(PACKAGE)): faults(path.read_text(encoding='utf-8'))
        for path in PACKAGE.rglob('*.py')
    }
    assert {path: lines for path, lines in found.items() if lines} == {}
