"""Has all formulas compiled; as a script, those of the package that is installed."""

import filecmp
import os
import pkgutil
import shutil
from importlib import import_module
from pathlib import Path

from redres_ros import kernels

HERE = Path(__file__).parents[1] / 'redres_ros' / 'kernels'


def compile_all() -> None:
    """The last module first: who imports them in order meanwhile compiles the others."""
    for module in reversed(list(pkgutil.iter_modules(kernels.__path__, f'{kernels.__name__}.'))):
        import_module(module.name)


if __name__ == '__main__':
    there = Path(kernels.__file__).parent
    sources = [source.name for source in HERE.glob('*.py')]
    same, _, _ = filecmp.cmpfiles(HERE, there, sources, shallow=False)
    if same == sources and there != HERE and os.access(there, os.W_OK):
        # numba compares the times of sources, which are copied, too: nothing is compiled twice.
        shutil.copytree(HERE, there, dirs_exist_ok=True)
    compile_all()
