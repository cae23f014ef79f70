"""Has all formulas compiled. As a script, those of the package that is installed, which may be
another copy than that beside this folder.
"""

import pkgutil
from importlib import import_module
from pathlib import Path

from redres_ros import kernels


def compile_all() -> None:
    for module in pkgutil.iter_modules(kernels.__path__, f'{kernels.__name__}.'):
        import_module(module.name)


# The copy beside this folder is compiled by the tests' process.
if __name__ == '__main__' and Path(kernels.__file__).parents[2] != Path(__file__).parents[1]:
    compile_all()
