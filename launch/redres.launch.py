"""The arm, its controller and the planner: ros2 launch redres_ros redres.launch.py [law:=NAME] …;
all arguments: ros2 launch redres_ros redres.launch.py --show-args.
"""

import math
from collections.abc import Iterable
from contextlib import suppress
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_prefix
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from redres_ros.errors import FileError, RedresError
from redres_ros.files.installation import share_path
from redres_ros.files.text import read_yaml
from redres_ros.robots import choose_arm
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
    'params_file': (
        '',
        'parameters of all nodes: a file, or a name in config/robots for a real robot, such as '
        'franka_fr3; empty: config/redres.yaml of this package',
    ),
    'use_sim_time': ('', 'take the time of the nodes from /clock; not with our own sim'),
    'sim': (
        '',
        'start the fake arm; false: states, URDF and frames come from a robot, as by default with '
        'a file in config/robots',
    ),
    'planner': ('true', 'start the planner; false: cartesian_velocity comes from elsewhere'),
    'composed': ('false', 'controller, planner and, if it is started, fake arm in one process'),
    'rviz': ('false', 'show the arm, its traces and the points of the task in RViz'),
    'log_level': ('', 'log level of our nodes: debug, info, warn, error or fatal'),
}
DEFAULT_ROBOT = 'lwr4_paper'
OF_EVERY_NODE = ('robot', 'rate', 'initial_state', 'use_sim_time')
OF_ONE = {
    'controller': ('law', 'limits', 'limit_scale'),
    'planner': ('task', 'autostart'),
    'sim': (),
}
NUMBERS = ('rate', 'limit_scale')
SWITCHES = ('autostart', 'use_sim_time', 'sim', 'planner', 'composed', 'rviz')
CHOICES = {
    'initial_state': ('unconfigured', 'inactive', 'active'),
    'log_level': ('debug', 'info', 'warn', 'error', 'fatal'),
    **dict.fromkeys(SWITCHES, ('true', 'false')),
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
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    check_names(context.argv)
    check_choices(given)
    file, is_of_robot = find_file(given['params_file'])
    with_sim = is_true(given['sim'] or str(not is_of_robot))
    check_together(given, with_sim)
    wanted = {'sim': with_sim, 'controller': True, 'planner': is_true(given['planner'])}
    names = [name for name, start in wanted.items() if start]
    description = ''  # the driver of a robot publishes its frames itself
    try:
        shared = parameters_in(file)
        if with_sim:
            robot = given['robot'] or shared.get('robot', DEFAULT_ROBOT)
            description = choose_arm(robot).description()
    except RedresError as error:
        raise ValueError(str(error)) from None
    if is_true(given['composed']):
        nodes = [ours('composed', names, file, given)]
    else:
        nodes = [ours(name, [name], file, given) for name in names]
    if with_sim:
        nodes.append(state_publisher(given, description))
    if is_true(given['rviz']):
        nodes.append(rviz(given, description, shared))
    return nodes


def find_file(params_file: str) -> tuple[Path, bool]:
    """The file of parameters, and whether it is one of ours for a real robot."""
    own = share_path('config/redres.yaml')
    of_robot = own.parent / 'robots' / f'{params_file}.yaml'
    if params_file and of_robot.is_file():
        return of_robot, True
    return Path(params_file) if params_file else own, False


def check_names(arguments: Iterable[str]) -> None:
    """Refuse a misspelt argument such as limit_scal:=0.2, which ROS ignores. Raises ValueError.

    A launch file that includes this one may have others.
    """
    for argument in arguments:
        name = argument.partition(':=')[0]
        if name not in ARGUMENTS and (near := get_close_matches(name, ARGUMENTS, 1, 0.8)):
            raise ValueError(f'{name}: no such argument; is {near[0]} meant?')


def check_choices(given: dict[str, str]) -> None:
    """Refuse a value that an argument cannot have. Raises ValueError that names the argument."""
    for name, allowed in CHOICES.items():
        if given[name] and given[name].lower() not in allowed:
            raise ValueError(f'{name}: got {given[name]!r}; allowed: {", ".join(allowed)}')
    for name in NUMBERS:
        with suppress(ValueError):
            if not given[name] or 0.0 < float(given[name]) < math.inf:
                continue
        raise ValueError(f'{name}: got {given[name]!r}; allowed: a positive number')


def check_together(given: dict[str, str], with_sim: bool) -> None:
    """Refuse arguments that do not go together. Raises ValueError."""
    if with_sim and given['robot'] == 'topic':
        raise ValueError("robot: got 'topic'; the fake arm itself publishes robot_description")
    if with_sim and is_true(given['use_sim_time']):
        raise ValueError("use_sim_time: got 'true'; the fake arm publishes no /clock")
    if not with_sim and not (given['robot'] or given['params_file']):
        raise ValueError("sim: got 'false'; a robot needs params_file:=FILE or robot:=NAME, too")
    if is_true(given['composed']) and not is_true(given['planner']):
        raise ValueError("composed: got 'true'; allowed only with planner:=true")


def parameters_in(file: Path) -> dict[str, Any]:
    """What a file has for all nodes, and for the fake arm. Raises FileError."""
    sections = read_yaml(file)
    if not isinstance(sections, dict):
        raise FileError(f'{file} has no ros__parameters; expected a parameter file of ROS 2')
    values = {}
    for key in ('/**', 'sim', '/**/sim'):
        values |= sections.get(key, {}).get('ros__parameters', {})
    return values


def ours(executable: str, names: list[str], file: Path, given: dict[str, str]) -> Node:
    """A process of this package with these nodes; when one of them ends, so do the others."""
    level = given['log_level']
    return Node(
        package='redres_ros',
        executable=executable,
        name=names[0] if len(names) == 1 else None,  # a name would be that of all its nodes
        namespace=given['namespace'],
        parameters=[str(file), parameters(names, given)],
        remappings=[('joint_states', given['states'])],
        arguments=['--no-sim'] if executable == 'composed' and 'sim' not in names else [],
        ros_arguments=['--log-level', level] if level else [],
        output='screen',
        on_exit=Shutdown(reason=f'{executable} ended'),
    )


def parameters(names: Iterable[str], given: dict[str, str]) -> dict[str, Any]:
    """What the arguments set of these nodes; an empty one would hide what params_file says."""
    wanted = [*OF_EVERY_NODE, *(parameter for name in names for parameter in OF_ONE[name])]
    values: dict[str, Any] = {key: given[key] for key in wanted if given[key]}
    for name in values:
        if name in NUMBERS:
            values[name] = float(values[name])
        elif name in SWITCHES:
            values[name] = is_true(values[name])
    return values


def state_publisher(given: dict[str, str], description: str) -> Node:
    """Publishes the frames of the arm's links; the URDF itself comes from the fake arm."""
    return Node(
        package=installed('robot_state_publisher'),
        executable='robot_state_publisher',
        namespace=given['namespace'],
        remappings=[
            *own_frames(given),
            ('joint_states', given['states']),
            ('robot_description', 'robot_state_publisher/robot_description'),
        ],
        parameters=[{'robot_description': description}],
    )


def installed(package: str) -> str:
    """A package of ROS, looked for before anything is started. Raises ValueError."""
    try:
        get_package_prefix(package)
    except LookupError:
        name = f'ros-$ROS_DISTRO-{package.replace("_", "-")}'
        raise ValueError(f'{package} is missing; expected: sudo apt install {name}') from None
    return package


def own_frames(given: dict[str, str]) -> list[tuple[str, str]]:
    """What keeps the frames of a robot in a namespace apart from another's of the same names."""
    return [('/tf', 'tf'), ('/tf_static', 'tf_static')] if given['namespace'] else []


def rviz(given: dict[str, str], description: str, shared: dict[str, Any]) -> Node:
    """Shows the arm as seen from its root link; the world if a driver has the URDF."""
    arguments = ['-d', str(share_path('config/redres.rviz'))]
    frames: list[tuple[str, str]] = []
    if description:
        frames = own_frames(given)
        urdf = Urdf.parsed(description)
        [root] = urdf.links.keys() - {joint.child for joint in urdf.joints}
        arguments += ['-f', root]
    by_clock = given['use_sim_time'] or str(shared.get('use_sim_time', False))
    return Node(
        package=installed('rviz2'),
        executable='rviz2',
        namespace=given['namespace'],
        remappings=frames,
        arguments=arguments,
        parameters=[{'use_sim_time': is_true(by_clock)}],
    )


def is_true(word: str) -> bool:
    """Whether a switch is on."""
    return word.lower() == 'true'
