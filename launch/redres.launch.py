"""The arm, its controller and the planner: ros2 launch redres_ros redres.launch.py [law:=NAME]
[namespace:=NAME].
"""

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare


def generate_launch_description() -> LaunchDescription:
    """The arguments, then one process for each node."""
    params_file = PathJoinSubstitution([FindPackageShare('redres_ros'), 'config', 'redres.yaml'])
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'params_file',
                default_value=params_file,
                description='parameters of all three nodes',
            ),
            DeclareLaunchArgument(
                'law', default_value='', description='control law; empty: the one in params_file'
            ),
            DeclareLaunchArgument(
                'namespace', default_value='', description='puts the robot under this name'
            ),
            OpaqueFunction(function=start_nodes),
        ]
    )


def start_nodes(context: LaunchContext) -> list[Node]:
    """The sim, the controller and the planner; when one of them ends, so do the others."""
    law = LaunchConfiguration('law').perform(context)
    chosen = [{'law': law}] if law else []  # an empty value would hide the law of params_file
    return [
        Node(
            package='redres_ros',
            executable=name,
            name=name,
            namespace=LaunchConfiguration('namespace'),
            parameters=[
                LaunchConfiguration('params_file'),
                *(chosen if name == 'controller' else []),
            ],
            output='screen',
            on_exit=Shutdown(reason=f'{name} ended'),
        )
        for name in ('sim', 'controller', 'planner')
    ]
