"""Launch files of robots: those of this package's own launch file, with other defaults."""

from collections.abc import Mapping
from typing import Any

from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

from redres_ros.files.share import share_path


def redres_with(defaults: Mapping[str, str]) -> list[Any]:
    """What redres.launch.py starts, with these defaults of its arguments, by their names."""
    declared = [
        DeclareLaunchArgument(name, default_value=value) for name, value in defaults.items()
    ]
    whole = PythonLaunchDescriptionSource(str(share_path('launch/redres.launch.py')))
    return [*declared, IncludeLaunchDescription(whole)]
