"""What help() shows: arguments, what comes back, and which errors of ours may come instead."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

PACKAGE = Path(__file__).resolve().parents[1] / 'redres_ros'
# Arguments of these are parts of one structure, told where that is made.
KERNELS = {'compiled', 'inlined'}
# With these begins a summary that says what there is or comes back; with others it is an order.
NO_ORDERS = """
A All An Another As Between Every From How Is J Joint Joints Limits Messages Nothing One Share Some
Stamps Table The Two What Where Whether Which x
"""

Function = ast.FunctionDef


class Documented(NamedTuple):
    """A function or method that others may call, and the docstrings that tell of it."""

    place: str
    function: Function
    docstring: str

    @property
    def arguments(self) -> list[str]:
        every = self.function.args
        names = [part.arg for part in (*every.posonlyargs, *every.args, *every.kwonlyargs)]
        names += [part.arg for part in (every.vararg, every.kwarg) if part]
        return [name for name in names if name not in ('self', 'cls')]

    @property
    def untold(self) -> list[str]:
        """Of several arguments, those that have no line below Args:."""
        told = self.docstring.partition('Args:\n')[2].partition('\n\n')[0]
        names = set(re.findall(r'^    \**(\w+): ', told, re.MULTILINE))
        arguments = self.arguments
        return [name for name in arguments if len(arguments) > 1 and name not in names]

    @property
    def returns(self) -> bool:
        """Whether something comes back that no framework asks for."""
        kind = ast.unparse(self.function.returns) if self.function.returns else 'None'
        return not kind.startswith(('None', 'NoReturn', 'Iterator', 'TransitionCallbackReturn'))

    @property
    def first_word(self) -> str:
        return (self.docstring.split() or [''])[0].strip('.,:;')

    @property
    def raised(self) -> set[str]:
        """Names of what is raised in the function itself."""
        return {
            ast.unparse(node.exc.func).rpartition('.')[2]
            for node in ast.walk(self.function)
            if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call)
        }


@cache
def trees() -> dict[str, ast.Module]:
    return {
        str(path.relative_to(PACKAGE)): ast.parse(path.read_text(encoding='utf-8'))
        for path in sorted(PACKAGE.rglob('*.py'))
    }


@cache
def classes() -> dict[str, ast.ClassDef]:
    """A test of the layers sees to it that no two share a name."""
    nodes = [node for tree in trees().values() for node in tree.body]
    return {node.name: node for node in nodes if isinstance(node, ast.ClassDef)}


@cache
def functions() -> tuple[Documented, ...]:
    """All that others may call."""
    return tuple(found for file, tree in trees().items() for found in in_file(file, tree))


def in_file(file: str, tree: ast.Module) -> Iterator[Documented]:
    own = [node for node in tree.body if isinstance(node, ast.ClassDef)]
    protocols = [node for node in own if 'Protocol' in bases(node)]
    for node in tree.body:
        if isinstance(node, Function):
            yield from documented(f'{file}: {node.name}', node, ast.get_docstring(node))
    for node in own:
        if not node.name.startswith('_'):
            yield from methods(f'{file}: {node.name}', node, protocols)


def methods(place: str, owner: ast.ClassDef, protocols: list[ast.ClassDef]) -> Iterator[Documented]:
    """Those of a class that neither a class above it nor a protocol of its file tells of."""
    above = ancestors(owner) + [protocol for protocol in protocols if protocol is not owner]
    for method in owner.body:
        if not isinstance(method, Function):
            continue
        told = ast.get_docstring(method)
        if method.name in ('__init__', '__post_init__'):
            yield from documented(place, method, told or ast.get_docstring(owner))
        elif not any(has(method.name, other) for other in above):
            yield from documented(f'{place}.{method.name}', method, told)


def documented(place: str, function: Function, docstring: str | None) -> Iterator[Documented]:
    """The function, if it is public and no kernel."""
    private = function.name.startswith('_') and not function.name.endswith('init__')
    decorators = {ast.unparse(decorator).partition('(')[0] for decorator in function.decorator_list}
    if not private and not decorators & KERNELS:
        yield Documented(place, function, docstring or '')


def bases(owner: ast.ClassDef) -> list[str]:
    return [ast.unparse(base).partition('[')[0] for base in owner.bases]


def ancestors(owner: ast.ClassDef) -> list[ast.ClassDef]:
    """The classes of the package above one."""
    found = []
    for name in bases(owner):
        if name in classes():
            found += [classes()[name], *ancestors(classes()[name])]
    return found


def has(method: str, owner: ast.ClassDef) -> bool:
    return any(isinstance(node, Function) and node.name == method for node in owner.body)


def test_functions_were_found() -> None:
    several = [found for found in functions() if len(found.arguments) > 1]
    assert len(several) > 100
    assert any(found.place == 'controller.py: Controller' for found in several)


def test_every_argument_is_told_of() -> None:
    assert [f'{found.place}: {found.untold}' for found in functions() if found.untold] == []


def test_what_comes_back_is_told_of() -> None:
    """By the summary, which is then no order; or in a half of its own; or below Returns:."""
    orders = {found.first_word for found in functions() if not found.returns} - {
        '',
        *NO_ORDERS.split(),
    }
    assert {'Write', 'Set', 'Refuse'} <= orders
    untold = [
        f'{found.place}: {found.docstring.splitlines()[0]}'
        for found in functions()
        if found.returns and found.first_word in orders
        if not re.search(r'Returns:|;|returned', found.docstring)
    ]
    assert untold == []


def test_errors_of_ours_are_told_of() -> None:
    """Each one by its name, or by that of the base class where there are many."""
    errors = {name for name in classes() if name.endswith('Error')}
    assert {'RedresError', 'RangeError', 'PluginError'} <= errors
    untold = [
        f'{found.place}: {error}'
        for found in functions()
        for error in found.raised & errors
        if error not in found.docstring and 'RedresError' not in found.docstring
    ]
    assert untold == []
