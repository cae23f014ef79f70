"""Where the package's share files are: a source checkout, a colcon workspace or a virtual
environment.
"""

import os
from pathlib import Path

from redres_ros.errors import FileError


def share_path(relative: str) -> Path:
    """Path of a share file such as 'config/tasks/rectangle.yaml'. Raises FileError that lists the
    places searched.

    The checkout comes first, because `pip install -e` installs no share files; then the prefix that
    this very package is installed under, which pip and colcon fill alike; then the overlays of a
    sourced ROS workspace, for a package that was moved.
    """
    here = Path(__file__).resolve()
    checkout = here.parents[2]
    prefix = here.parents[5:6]  # of <prefix>/lib/python3.x/site-packages/redres_ros/files/share.py
    overlays = [
        Path(overlay)
        for overlay in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
        if overlay
    ]
    roots = [checkout] if (checkout / 'package.xml').is_file() else []
    roots += [place / 'share/redres_ros' for place in (*prefix, *overlays)]
    for root in roots:
        if (root / relative).exists():
            return root / relative
    raise FileError(f'{relative} is not installed; looked in {", ".join(map(str, roots))}')
