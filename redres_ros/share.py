"""Where the package's share files are: a source checkout, a colcon workspace or a virtual environment."""

import os
import sysconfig
from pathlib import Path

from redres_ros.errors import FileError


def share_path(relative: str) -> Path:
    """Path of a share file such as 'config/tasks/rectangle.yaml'. Raises FileError that lists the places searched.

    The checkout comes first, because `pip install -e` installs no share files; then the overlays of a sourced ROS workspace;
    then the prefix of the running Python, which pip fills and of which ROS knows nothing.
    """
    overlays = [Path(prefix) / 'share/redres_ros' for prefix in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep) if prefix]
    checkout = Path(__file__).resolve().parent.parent
    roots = [checkout] if (checkout / 'package.xml').is_file() else []
    roots += [*overlays, Path(sysconfig.get_path('data')) / 'share/redres_ros']
    for root in roots:
        if (root / relative).exists():
            return root / relative
    raise FileError(f"{relative} is not installed; looked in {', '.join(map(str, roots))}")
