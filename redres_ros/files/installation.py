"""The installation of this package: its share files, and how to install what is missing."""

import os
import sys
from pathlib import Path

from redres_ros.errors import FileError

# Packages on PyPI whose names are not those of their modules.
_PACKAGES = {
    'pinocchio': 'pin',
    'rclpy': "'ros-jazzy-rclpy[fastrtps]' ros-jazzy-common-interfaces",
    'yaml': 'PyYAML',
}
_MARKER = 'share/ament_index/resource_index/packages/redres_ros'
# In package.xml. pip would bring another numpy than the one that the distribution's packages take.
_BY_ROSDEP = {'matplotlib', 'numba', 'numpy', 'pinocchio', 'rich', 'scipy', 'yaml'}


def share_path(relative: str) -> Path:
    """Path of a share file such as 'config/tasks/rectangle.yaml'. Raises FileError with the places
    searched: the checkout, because `pip install -e` installs no share files; the prefix that this
    very package is under, which pip and colcon fill alike; overlays, for a package that was moved.
    """
    here = Path(__file__).resolve()
    checkout = here.parents[2]
    # Of <prefix>/lib/python3.x/site-packages/redres_ros/files/installation.py:
    prefixes = [*here.parents[5:6], *map(Path, _overlays())]
    roots = [checkout] if (checkout / 'package.xml').is_file() else []
    roots += [prefix / 'share/redres_ros' for prefix in prefixes]
    for root in roots:
        if (root / relative).exists():
            return root / relative
    raise FileError(f'{relative} is not installed; looked in {", ".join(map(str, roots))}')


def not_installed(module: str) -> str:
    """One line on a module that is missing, and how to get it."""
    return f'the package {module} is not installed; install it with: {remedy(module)}'


def remedy(module: str) -> str:
    """The command that installs a module: by pip, or in a ROS workspace by rosdep."""
    others = set(_overlays()) - {sys.prefix}
    is_in_workspace = any((Path(prefix) / _MARKER).exists() for prefix in others)  # by colcon
    if is_in_workspace and module in _BY_ROSDEP:
        return 'rosdep install --from-paths src --ignore-src'
    return f'pip install {_PACKAGES.get(module, module)}'


def _overlays() -> list[str]:
    """The prefixes of a sourced ROS workspace."""
    return [path for path in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep) if path]
