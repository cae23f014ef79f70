"""How to install what is missing: by pip as an extra of this package; in a ROS workspace by
rosdep, or as a single package.
"""

import os
import sys
from pathlib import Path

# Extras that bring a module; all others come with [ros].
_EXTRAS = {'mujoco': 'fake', 'scipy': 'paper', 'viser': 'view'}
_FOR = {'mujoco': 'the fake robot needs mujoco, which'}
_MARKER = 'share/ament_index/resource_index/packages/redres_ros'
# In package.xml. pip would bring another numpy than the one that the distribution's packages take.
_BY_ROSDEP = {'matplotlib', 'numba', 'numpy', 'pinocchio', 'rich', 'scipy', 'yaml'}
_ON_PYPI = {  # where the name of the package is not that of its module or solver
    'pink': 'pin-pink',
    'proxqp': 'proxsuite',
    'roboplan': 'roboplan-oink',
}


def not_installed(module: str) -> str:
    """One line on a module that is missing, and how to get it."""
    what = _FOR.get(module, f'the package {module}')
    return f'{what} is not installed; install it with: {remedy(_EXTRAS.get(module, "ros"), module)}'


def remedy(extra: str, *modules: str) -> str:
    """The command that installs modules.

    Args:
        extra: Extra of this package, which has them.
        modules: Names as they are imported.
    """
    if not _is_in_workspace():
        return f"pip install 'redres_ros[{extra}]'"
    if _BY_ROSDEP.issuperset(modules):
        return 'rosdep install --from-paths src --ignore-src'
    return f'pip install {" ".join(_ON_PYPI.get(module, module) for module in modules)}'


def _is_in_workspace() -> bool:
    """Whether ROS's own tools have installed this package, as colcon does."""
    prefixes = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    others = [prefix for prefix in prefixes if prefix and prefix != sys.prefix]
    return any((Path(prefix) / _MARKER).exists() for prefix in others)
