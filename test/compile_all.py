"""Has all formulas compiled. As a script, those of the package that is installed, which may be
another copy than that beside this folder.
"""

import pkgutil
from importlib import import_module

from redres_ros import kernels


def compile_all() -> None:
    for module in pkgutil.iter_modules(kernels.__path__, f'{kernels.__name__}.'):
        import_module(module.name)


if __name__ == '__main__':
    compile_all()
