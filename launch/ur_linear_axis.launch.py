"""Controller and planner for a UR on a linear axis behind its driver: see docs/real_robots.md. The
arguments are those of redres.launch.py.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

from redres_ros.files.share import share_path

DEFAULTS = {
    'params_file': str(share_path('config/robots/ur_linear_axis.yaml')),
    'sim': 'false',
}


def generate_launch_description() -> LaunchDescription:
    """What redres.launch.py starts, with these defaults."""
    declared = [
        DeclareLaunchArgument(name, default_value=value) for name, value in DEFAULTS.items()
    ]
    whole = PythonLaunchDescriptionSource(str(share_path('launch/redres.launch.py')))
    return LaunchDescription([*declared, IncludeLaunchDescription(whole)])
