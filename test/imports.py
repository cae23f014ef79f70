"""Who imports whom in the package, read from its sources."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import redres_ros

PACKAGE = Path(redres_ros.__file__).parent
ROS = r'(rcl|rpy|ros|rmw|ament|launch|tf2|unique_identifier)\w*|\w+_(msgs|srvs|interfaces)'

WITH_ROS = {'nodes', 'graph', 'demo', 'preflight', 'view'}  # subpackages


class Import(NamedTuple):
    """The importing file, relative to the package; the module imported; whether it happens when the
    file is loaded.
    """

    file: str
    module: str
    on_loading: bool

    @property
    def library(self) -> str:
        return self.module.partition('.')[0]


def statements(node: ast.AST, on_loading: bool = True) -> Iterator[tuple[ast.AST, bool]]:
    """Those below a node, each with whether it is executed when the file is loaded."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, (ast.stmt, ast.ExceptHandler, ast.match_case)):
            is_typing = isinstance(child, ast.If) and ast.unparse(child.test) == 'TYPE_CHECKING'
            is_later = is_typing or isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef))
            yield child, on_loading
            yield from statements(child, on_loading and not is_later)


def imports_of(path: Path) -> Iterator[Import]:
    file = path.relative_to(PACKAGE).as_posix()
    for node, on_loading in statements(ast.parse(path.read_text(encoding='utf-8'))):
        if isinstance(node, ast.Import):
            yield from (Import(file, alias.name, on_loading) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            module = node.module or ''
            if node.level:  # relative: none is in use, but it would count
                parts = ('redres_ros', *Path(file).parts)
                module = '.'.join((*parts[: len(parts) - node.level], *filter(None, (module,))))
            # `from redres_ros import laws` imports the module laws
            modules = (
                [f'{module}.{alias.name}' for alias in node.names]
                if module == 'redres_ros'
                else [module]
            )
            yield from (Import(file, name, on_loading) for name in modules)


@cache
def imports() -> tuple[Import, ...]:
    """All of them. Reading them takes a second, which only who asks should pay."""
    return tuple(found for path in sorted(PACKAGE.rglob('*.py')) for found in imports_of(path))


def files_with(library: str) -> set[str]:
    return {found.file for found in imports() if re.fullmatch(library, found.library)}


def subpackage(name: str) -> str:
    """Of a file or module of the package: 'laws' for laws/law.py and redres_ros.laws.law."""
    return name.removeprefix('redres_ros.').split('.')[0].split('/')[0]
