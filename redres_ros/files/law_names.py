"""The names of the laws, from the source of their table: loading it would compile the formulas,
which takes a quarter of a minute the first time.
"""

import ast
from pathlib import Path

from redres_ros.errors import UnknownNameError
from redres_ros.files.installed import installed

_SOURCE = Path(__file__).parents[1] / 'laws' / '__init__.py'


def check_law(name: str) -> None:
    """Refuse a name that is no law's. Raises UnknownNameError.

    Args:
        name: One that no plugin file adds.
    """
    own = _names()
    if name not in own:
        known = [*own, *installed('laws')]
        if name not in known:
            raise UnknownNameError('law', name, known)


def _names() -> list[str]:
    """The keys of the table LAWS."""
    tree = ast.parse(_SOURCE.read_text(encoding='utf-8'))
    [table] = [node.value for node in tree.body if isinstance(node, ast.AnnAssign)]
    keys = table.keys if isinstance(table, ast.Dict) else []
    return [
        key.value for key in keys if isinstance(key, ast.Constant) and isinstance(key.value, str)
    ]
