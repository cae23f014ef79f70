"""The arm, its controller and the planner: ros2 launch redres_ros redres.launch.py [law:=NAME] …;
all arguments: ros2 launch redres_ros redres.launch.py --show-args.
"""

from pathlib import Path
from typing import Any

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from redres_ros.files.share import share_path
from redres_ros.files.yaml import read_yaml
from redres_ros.robots import choose_arm
from redres_ros.robots.urdf import Urdf

# name: (default, description); an empty default leaves what params_file says
ARGUMENTS = {
    'robot': ('', 'arm: a name that `redres laws` prints, a URDF file, or topic'),
    'law': ('', 'law of the controller, as minimum_acceleration'),
    'limits': ('', 'limits of the controller, as position,velocity,acceleration or none'),
    'rate': ('', 'cycles per second [Hz]'),
    'namespace': ('', 'puts the robot under this name'),
    'params_file': ('', 'parameters of all nodes; empty: config/redres.yaml of this package'),
    'use_sim_time': ('false', 'take the time of the nodes from /clock'),
    'sim': ('true', 'start the fake arm; false: states, URDF and frames come from a robot'),
    'planner': ('true', 'start the planner; false: cartesian_velocity comes from elsewhere'),
    'rviz': ('false', 'show the arm, its traces and the points of the task in RViz'),
}
DEFAULT_ROBOT = 'lwr4_paper'


def generate_launch_description() -> LaunchDescription:
    """The arguments, then one process for each node."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=description)
        for name, (default, description) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=start_nodes)])


def start_nodes(context: LaunchContext) -> list[Node]:
    """The nodes that the arguments ask for."""
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    wanted = {
        'sim': _is_true(given['sim']),
        'controller': True,
        'planner': _is_true(given['planner']),
    }
    nodes = [_of_ours(name, given) for name, start in wanted.items() if start]
    # The driver of a robot publishes its frames itself.
    description = ''
    if wanted['sim'] and given['robot'] != 'topic':
        description = choose_arm(given['robot'] or _robot_in(_file(given))).description()
        nodes.append(_state_publisher(given, description))
    if _is_true(given['rviz']):
        nodes.append(_rviz(given, description))
    return nodes


def _of_ours(name: str, given: dict[str, str]) -> Node:
    """A node of this package; when one of them ends, so do the others."""
    return Node(
        package='redres_ros',
        executable=name,
        name=name,
        namespace=given['namespace'],
        parameters=[_file(given), _parameters(name, given)],
        output='screen',
        on_exit=Shutdown(reason=f'{name} ended'),
    )


def _file(given: dict[str, str]) -> str:
    return given['params_file'] or str(share_path('config/redres.yaml'))


def _parameters(name: str, given: dict[str, str]) -> dict[str, Any]:
    """What the arguments set; an empty one would hide what params_file says."""
    of_every_node = ('robot', 'rate')
    of_the_controller = ('law', 'limits')
    names = of_every_node + (of_the_controller if name == 'controller' else ())
    values: dict[str, Any] = {key: given[key] for key in names if given[key]}
    if 'rate' in values:
        values['rate'] = float(values['rate'])
    return {**values, 'use_sim_time': _is_true(given['use_sim_time'])}


def _state_publisher(given: dict[str, str], description: str) -> Node:
    """Publishes the frames of the arm's links.

    Args:
        given: The arguments.
        description: URDF of the arm.
    """
    return Node(
        package='robot_state_publisher',
        executable='robot_state_publisher',
        namespace=given['namespace'],
        remappings=_own_frames(given),
        parameters=[
            {
                'robot_description': description,
                'use_sim_time': _is_true(given['use_sim_time']),
            }
        ],
    )


def _own_frames(given: dict[str, str]) -> list[tuple[str, str]]:
    """What keeps the frames of a robot in a namespace apart from another's of the same names."""
    if not given['namespace']:
        return []
    return [('/tf', 'tf'), ('/tf_static', 'tf_static')]


def _robot_in(file: str) -> str:
    """The arm that a file of parameters names for all nodes, or for the fake arm."""
    sections = read_yaml(Path(file))
    robot = DEFAULT_ROBOT
    for key in ('/**', 'sim', '/**/sim'):
        robot = sections.get(key, {}).get('ros__parameters', {}).get('robot', robot)
    return robot


def _rviz(given: dict[str, str], description: str) -> Node:
    """Shows the arm as seen from its root link.

    Args:
        given: The arguments.
        description: URDF of the arm; empty where a driver has it, and RViz shows the world.
    """
    arguments = ['-d', str(share_path('config/redres.rviz'))]
    frames: list[tuple[str, str]] = []
    if description:
        frames = _own_frames(given)
        urdf = Urdf.read(description)
        [root] = urdf.links.keys() - {joint.child for joint in urdf.joints}
        arguments += ['-f', root]
    return Node(
        package='rviz2',
        executable='rviz2',
        namespace=given['namespace'],
        remappings=frames,
        arguments=arguments,
        parameters=[{'use_sim_time': _is_true(given['use_sim_time'])}],
    )


def _is_true(word: str) -> bool:
    if word.lower() not in ('true', 'false'):
        raise ValueError(f'got {word!r}; allowed: true or false')
    return word.lower() == 'true'
