"""Controller and planner for a Franka Research 3 behind franka_ros2: see docs/real_robots.md. The
arguments are those of redres.launch.py.
"""

from launch import LaunchDescription

from redres_ros.files.share import share_path
from redres_ros.nodes.launch_defaults import redres_with

DEFAULTS = {
    'params_file': str(share_path('config/robots/franka_fr3.yaml')),
    'sim': 'false',
    'states': 'franka/joint_states',
}


def generate_launch_description() -> LaunchDescription:
    """What redres.launch.py starts, with these defaults."""
    return LaunchDescription(redres_with(DEFAULTS))
