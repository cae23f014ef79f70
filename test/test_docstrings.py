"""What help() shows: every public function with several arguments says what each of them is."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

PACKAGE = Path(__file__).resolve().parents[1] / 'redres_ros'
KERNELS = {'compiled'}  # their arguments are parts of one structure, told where that is made

Function = ast.FunctionDef


class Documented(NamedTuple):
    """A function or method, and the docstring that tells of its arguments."""

    place: str
    arguments: list[str]
    docstring: str

    @property
    def untold(self) -> list[str]:
        """The arguments that have no line below Args:."""
        told = self.docstring.partition('Args:\n')[2].partition('\n\n')[0]
        names = set(re.findall(r'^    \**(\w+): ', told, re.MULTILINE))
        return [name for name in self.arguments if name not in names]


TREES = {
    str(path.relative_to(PACKAGE)): ast.parse(path.read_text(encoding='utf-8'))
    for path in sorted(PACKAGE.rglob('*.py'))
}
# A test of the layers sees to it that no two share a name.
CLASSES = {
    node.name: node
    for tree in TREES.values()
    for node in tree.body
    if isinstance(node, ast.ClassDef)
}


def functions() -> Iterator[Documented]:
    """Those with several arguments that others may call."""
    for file, tree in TREES.items():
        protocols = [
            node
            for node in tree.body
            if isinstance(node, ast.ClassDef) and 'Protocol' in bases(node)
        ]
        for node in tree.body:
            if isinstance(node, Function):
                yield from documented(f'{file}: {node.name}', node, ast.get_docstring(node))
            elif isinstance(node, ast.ClassDef) and not node.name.startswith('_'):
                yield from methods(f'{file}: {node.name}', node, protocols)


def methods(place: str, owner: ast.ClassDef, protocols: list[ast.ClassDef]) -> Iterator[Documented]:
    """Those of a class that neither a class above it nor a protocol of its file tells of."""
    above = ancestors(owner) + [protocol for protocol in protocols if protocol is not owner]
    for method in owner.body:
        if not isinstance(method, Function):
            continue
        told = ast.get_docstring(method)
        if method.name == '__init__':
            yield from documented(place, method, told or ast.get_docstring(owner))
        elif not any(has(method.name, other) for other in above):
            yield from documented(f'{place}.{method.name}', method, told)


def documented(place: str, function: Function, docstring: str | None) -> Iterator[Documented]:
    """The function, if it is public, no kernel, and has several arguments."""
    private = function.name.startswith('_') and function.name != '__init__'
    decorators = {ast.unparse(decorator).partition('(')[0] for decorator in function.decorator_list}
    every = function.args
    names = [part.arg for part in (*every.posonlyargs, *every.args, *every.kwonlyargs)]
    names += [part.arg for part in (every.vararg, every.kwarg) if part]
    arguments = [name for name in names if name not in ('self', 'cls')]
    if not private and not decorators & KERNELS and len(arguments) > 1:
        yield Documented(place, arguments, docstring or '')


def bases(owner: ast.ClassDef) -> list[str]:
    return [ast.unparse(base).partition('[')[0] for base in owner.bases]


def ancestors(owner: ast.ClassDef) -> list[ast.ClassDef]:
    """The classes of the package above one."""
    found = []
    for name in bases(owner):
        if name in CLASSES:
            found += [CLASSES[name], *ancestors(CLASSES[name])]
    return found


def has(method: str, owner: ast.ClassDef) -> bool:
    return any(isinstance(node, Function) and node.name == method for node in owner.body)


ALL = list(functions())


def test_functions_were_found() -> None:
    assert len(ALL) > 100
    assert any(found.place == 'controller.py: Controller' for found in ALL)


def test_every_argument_is_told_of() -> None:
    assert [f'{found.place}: {found.untold}' for found in ALL if found.untold] == []
