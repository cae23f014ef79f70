"""The arm, its controller and the planner: ros2 launch redres_ros redres.launch.py [law:=NAME] …;
all arguments: ros2 launch redres_ros redres.launch.py --show-args.
"""

import math
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from redres_ros.errors import FileError, RedresError
from redres_ros.files.share import share_path
from redres_ros.files.yaml import read_yaml
from redres_ros.nodes.entry import check_law
from redres_ros.robots import choose_arm
from redres_ros.robots.table import ALLOWED, names_an_arm
from redres_ros.robots.urdf import Urdf

# name: (default, description); an empty default leaves what params_file says
ARGUMENTS = {
    'robot': ('', 'arm: a name that `redres laws` prints, a URDF file, or topic'),
    'task': ('', 'task: a name in config/tasks or a path ending in .yaml'),
    'law': ('', 'law of the controller, such as minimum_acceleration'),
    'limits': ('', 'limits of the controller, such as position,velocity,acceleration or none'),
    'limit_scale': ('', 'fraction of the velocity and acceleration limits, such as 0.2'),
    'rate': ('', 'cycles per second [Hz]'),
    'autostart': ('', 'true: the task begins as soon as the robot takes commands'),
    'initial_state': ('', 'life cycle of our nodes: unconfigured, inactive or active'),
    'namespace': ('', 'puts the robot under this name'),
    'states': ('joint_states', 'topic of the states, such as franka/joint_states'),
    'params_file': ('', 'parameters of all nodes; empty: config/redres.yaml of this package'),
    'use_sim_time': ('', 'take the time of the nodes from /clock; not with our own sim'),
    'sim': ('true', 'start the fake arm; false: states, URDF and frames come from a robot'),
    'planner': ('true', 'start the planner; false: cartesian_velocity comes from elsewhere'),
    'composed': ('false', 'controller, planner and, if it is started, fake arm in one process'),
    'rviz': ('false', 'show the arm, its traces and the points of the task in RViz'),
    'log_level': ('', 'log level of our nodes: debug, info, warn, error or fatal'),
}
DEFAULT_ROBOT = 'lwr4_paper'
TOPIC = 'topic'  # in place of an arm's name
OF_EVERY_NODE = ('robot', 'rate', 'initial_state', 'use_sim_time')
OF_ONE = {
    'controller': ('law', 'limits', 'limit_scale'),
    'planner': ('task', 'autostart'),
    'sim': (),
}
NUMBERS = ('rate', 'limit_scale')
OF_ROS = ('launch-prefix', 'launch-prefix-filter')  # options that `ros2 launch` adds as arguments
CHOICES = {
    'initial_state': ('unconfigured', 'inactive', 'active'),
    'log_level': ('debug', 'info', 'warn', 'error', 'fatal'),
    **dict.fromkeys(('autostart', 'use_sim_time', 'sim', 'planner', 'composed', 'rviz'), ()),
}


def generate_launch_description() -> LaunchDescription:
    """The arguments, then one process for each node."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=description)
        for name, (default, description) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=start_nodes)])


def start_nodes(context: LaunchContext) -> list[Node]:
    """The nodes that the arguments ask for."""
    if _is_ours(sys.argv):
        _check_names(context.argv)
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    _check(given)
    with_sim = _is_true(given['sim'])
    wanted = {'sim': with_sim, 'controller': True, 'planner': _is_true(given['planner'])}
    names = [name for name, start in wanted.items() if start]
    nodes = [_of_ours(name, [name], given) for name in names]
    if _is_true(given['composed']):
        nodes = [_of_ours('composed', names, given)]
    # The driver of a robot publishes its frames itself.
    description = ''
    if with_sim:
        robot = given['robot'] or _found(_file(given), 'robot', DEFAULT_ROBOT)
        with _naming('robot'):
            description = choose_arm(robot).description()
        nodes.append(_state_publisher(given, description))
    if _is_true(given['rviz']):
        nodes.append(_rviz(given, description))
    return nodes


def _is_ours(command: Iterable[str]) -> bool:
    """Whether a command starts a launch file of this package: one that includes it may have
    arguments of its own.
    """
    files = [Path(word) for word in command if ':=' not in word]
    beside = [file.with_name(Path(__file__).name) for file in files if file.is_file()]
    return Path('redres_ros') in files or any(file.is_file() for file in beside)


def _check_names(arguments: Iterable[str]) -> None:
    """Refuse an argument that does not exist, which ROS ignores.

    Args:
        arguments: As the command line has them: name:=value.

    Raises:
        ValueError: Names it, and those that exist.
    """
    for argument in arguments:
        name, _, _ = argument.partition(':=')
        if name not in ARGUMENTS and name not in OF_ROS:
            raise ValueError(f'{name}: no such argument; allowed: {", ".join(ARGUMENTS)}')


def _check(given: dict[str, str]) -> None:
    """Refuse what cannot be meant.

    Args:
        given: The arguments.

    Raises:
        ValueError: Names the argument, what it got, and what is allowed.
    """
    for name, choices in CHOICES.items():
        allowed = choices or ('true', 'false')
        if given[name] and given[name].lower() not in allowed:
            raise ValueError(f'{name}: got {given[name]!r}; allowed: {", ".join(allowed)}')
    _check_robot(given)
    with _naming('params_file'):
        _check_sections(_file(given))
    if given['law'] and not given['params_file']:  # such a file may name plugins
        with _naming('law'):
            check_law(given['law'])
    for name in NUMBERS:
        if given[name] and not _is_positive(given[name]):
            raise ValueError(f'{name}: got {given[name]!r}; allowed: a positive number')
    if _is_true(given['composed']) and not _is_true(given['planner']):
        raise ValueError("composed: got 'true'; allowed only with planner:=true")


def _check_robot(given: dict[str, str]) -> None:
    """Refuse an arm that is unknown, or that cannot be had with or without the fake arm."""
    robot = given['robot']
    if robot and robot != TOPIC and not names_an_arm(robot):
        raise ValueError(f'robot: got {robot!r}; allowed: {", ".join((*ALLOWED, TOPIC))}')
    if _is_true(given['sim']):
        if robot == TOPIC:
            raise ValueError("robot: got 'topic'; the fake arm itself publishes robot_description")
        if _is_true(given['use_sim_time']):
            raise ValueError("use_sim_time: got 'true'; the fake arm publishes no /clock")
    elif not (robot or given['params_file']):
        raise ValueError("sim: got 'false'; a robot needs params_file:=FILE or robot:=NAME, too")


def _check_sections(file: str) -> None:
    """Refuse a file without parameters of nodes. Raises FileError."""
    sections = read_yaml(Path(file))
    found = isinstance(sections, dict) and any(
        isinstance(section, dict) and 'ros__parameters' in section for section in sections.values()
    )
    if not found:
        raise FileError(f'{file} has no ros__parameters; expected a parameter file of ROS 2')


@contextmanager
def _naming(argument: str) -> Iterator[None]:
    """Name the argument that an error is about."""
    try:
        yield
    except RedresError as error:
        raise ValueError(f'{argument}: {error}') from None


def _of_ours(executable: str, names: list[str], given: dict[str, str]) -> Node:
    """A process of this package; when one of them ends, so do the others.

    Args:
        executable: What is run.
        names: Of its nodes.
        given: The arguments.
    """
    level = given['log_level']
    return Node(
        package='redres_ros',
        executable=executable,
        name=names[0] if len(names) == 1 else None,  # a name would be that of all its nodes
        namespace=given['namespace'],
        parameters=[_file(given), _parameters(names, given)],
        remappings=_states(given),
        arguments=['--no-sim'] if executable == 'composed' and 'sim' not in names else [],
        ros_arguments=['--log-level', level] if level else [],
        output='screen',
        on_exit=Shutdown(reason=f'{executable} ended'),
    )


def _states(given: dict[str, str]) -> list[tuple[str, str]]:
    """What takes the states from another topic."""
    states = given['states']
    return [] if states == 'joint_states' else [('joint_states', states)]


def _file(given: dict[str, str]) -> str:
    return given['params_file'] or str(share_path('config/redres.yaml'))


def _parameters(names: Iterable[str], given: dict[str, str]) -> dict[str, Any]:
    """What the arguments set; an empty one would hide what params_file says.

    Args:
        names: Of the nodes in a process.
        given: The arguments.
    """
    wanted = [*OF_EVERY_NODE, *(parameter for name in names for parameter in OF_ONE[name])]
    values: dict[str, Any] = {key: given[key] for key in wanted if given[key]}
    for name in values.keys() & set(NUMBERS):
        values[name] = float(values[name])
    for name in values.keys() & {'autostart', 'use_sim_time'}:
        values[name] = _is_true(values[name])
    return values


def _state_publisher(given: dict[str, str], description: str) -> Node:
    """Publishes the frames of the arm's links; the URDF itself comes from the fake arm.

    Args:
        given: The arguments.
        description: URDF of the arm.
    """
    return Node(
        package='robot_state_publisher',
        executable='robot_state_publisher',
        namespace=given['namespace'],
        remappings=[
            *_own_frames(given),
            *_states(given),
            ('robot_description', 'robot_state_publisher/robot_description'),
        ],
        parameters=[{'robot_description': description}],
    )


def _own_frames(given: dict[str, str]) -> list[tuple[str, str]]:
    """What keeps the frames of a robot in a namespace apart from another's of the same names."""
    if not given['namespace']:
        return []
    return [('/tf', 'tf'), ('/tf_static', 'tf_static')]


def _found(file: str, parameter: str, default: Any) -> Any:
    """A parameter that a file has for all nodes, or for the fake arm.

    Args:
        file: Of parameters.
        parameter: Its name.
        default: If the file has none.
    """
    sections = read_yaml(Path(file))
    value = default
    for key in ('/**', 'sim', '/**/sim'):
        value = sections.get(key, {}).get('ros__parameters', {}).get(parameter, value)
    return value


def _rviz(given: dict[str, str], description: str) -> Node:
    """Shows the arm as seen from its root link.

    Args:
        given: The arguments.
        description: URDF of the arm; empty where a driver has it, and RViz shows the world.
    """
    arguments = ['-d', str(share_path('config/redres.rviz'))]
    frames: list[tuple[str, str]] = []
    by_clock = given['use_sim_time'] or str(_found(_file(given), 'use_sim_time', False))
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
        parameters=[{'use_sim_time': _is_true(by_clock)}],
    )


def _is_true(word: str) -> bool:
    return word.lower() == 'true'


def _is_positive(word: str) -> bool:
    try:
        return 0.0 < float(word) < math.inf
    except ValueError:
        return False
