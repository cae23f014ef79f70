"""The launch file: its arguments, and the processes that they make.

No package index has ROS's launch. Where it is not installed a stand-in with the five names that the
file uses takes its place; where it is, both must make the same processes.
"""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml

from redres_ros.files.installation import share_path
from redres_ros.robots import find_arm

ROOT = Path(__file__).resolve().parents[1]
FILE = ROOT / 'launch' / 'redres.launch.py'
OURS = {'sim', 'controller', 'planner'}


class Recorded(SimpleNamespace):
    """An action that keeps what it was made with."""

    def __init__(self, name: str = '', **given: Any) -> None:
        super().__init__(name=name, **given)


def configuration(name: str) -> SimpleNamespace:
    """The value of an argument in the context."""
    return SimpleNamespace(perform=lambda context: str(context.launch_configurations[name]))


def stand_in() -> dict[str, ModuleType]:
    """Modules with the names of launch that the file uses."""
    names: dict[str, dict[str, Any]] = {
        'ament_index_python.packages': {'get_package_prefix': str},
        'launch': {'LaunchContext': SimpleNamespace, 'LaunchDescription': list},
        'launch.actions': dict.fromkeys(
            ('DeclareLaunchArgument', 'IncludeLaunchDescription', 'OpaqueFunction', 'Shutdown'),
            Recorded,
        ),
        'launch.launch_description_sources': {'PythonLaunchDescriptionSource': str},
        'launch.substitutions': {'LaunchConfiguration': configuration},
        'launch_ros': {},
        'launch_ros.actions': {'Node': Recorded},
    }
    modules = {}
    for name, values in names.items():
        modules[name] = ModuleType(name)
        vars(modules[name]).update(values)
    return modules


@pytest.fixture
def launch_file(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    for name, module in stand_in().items():
        monkeypatch.setitem(sys.modules, name, module)
    spec = importlib.util.spec_from_file_location('redres_launch', FILE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def started(launch_file: ModuleType, **given: str) -> dict[str, Recorded]:
    """The nodes that the arguments start, by executable."""
    defaults = {a.name: a.default_value for a in launch_file.generate_launch_description()[:-1]}
    argv = [f'{name}:={value}' for name, value in given.items()]
    context = SimpleNamespace(launch_configurations={**defaults, **given}, argv=argv)
    return {node.executable: node for node in launch_file.start_nodes(context)}


def test_by_default_the_fake_arm_its_controller_the_planner_and_the_frames_are_started(launch_file):
    nodes = started(launch_file)
    assert nodes.keys() == OURS | {'robot_state_publisher'}
    for name in OURS:
        assert nodes[name].on_exit.reason == f'{name} ended'  # and so do the others
        file, values = nodes[name].parameters
        assert file == str(share_path('config/redres.yaml'))
        assert values == {}  # what the file says is not hidden


def test_arguments_become_parameters_of_the_nodes_that_have_them(launch_file):
    nodes = started(
        launch_file,
        robot='fr3',
        law='minimum_velocity',
        limits='none',
        limit_scale='0.2',
        rate='250',
        namespace='left',
        task='table',
        autostart='true',
        initial_state='inactive',
        log_level='debug',
    )
    shared = {'robot': 'fr3', 'rate': 250.0, 'initial_state': 'inactive'}
    assert nodes['sim'].parameters[1] == shared
    assert nodes['planner'].parameters[1] == {**shared, 'task': 'table', 'autostart': True}
    assert all(nodes[name].ros_arguments == ['--log-level', 'debug'] for name in OURS)
    own = {'law': 'minimum_velocity', 'limits': 'none', 'limit_scale': 0.2}
    assert nodes['controller'].parameters[1] == {**shared, **own}
    assert {node.namespace for node in nodes.values()} == {'left'}
    description = nodes['robot_state_publisher'].parameters[0]['robot_description']
    assert ElementTree.fromstring(description).get('name') == 'fr3'


def test_on_a_robot_only_what_it_lacks_is_started(launch_file):
    nodes = started(launch_file, robot='fr3', sim='false', planner='false', rviz='true')
    assert nodes.keys() == {'controller', 'rviz2'}  # the driver publishes the frames
    assert started(launch_file, robot='topic', sim='false').keys() == {'controller', 'planner'}
    nodes = started(launch_file, params_file='franka_fr3')
    assert nodes.keys() == {'controller', 'planner'}
    assert nodes['controller'].parameters[0] == str(share_path('config/robots/franka_fr3.yaml'))


@pytest.mark.parametrize(
    ('given', 'words'),
    [
        ({'sim': 'maybe'}, ("sim: got 'maybe'", 'true, false')),
        ({'autostart': '1'}, ("autostart: got '1'",)),
        ({'log_level': 'loud'}, ("log_level: got 'loud'", 'debug, info, warn, error, fatal')),
        ({'initial_state': 'on'}, ("initial_state: got 'on'", 'unconfigured, inactive, active')),
        ({'rate': 'fast'}, ("rate: got 'fast'",)),
        ({'rate': '0'}, ("rate: got '0'", 'a positive number')),
        ({'limit_scale': '-1'}, ("limit_scale: got '-1'", 'a positive number')),
        ({'robot': 'r2d2'}, ("robot 'r2d2'", 'lwr4_paper', 'planar4r', '.urdf')),
        ({'robot': 'topic'}, ("robot: got 'topic'", 'robot_description')),
        ({'params_file': '/no/such.yaml'}, ('/no/such.yaml',)),
        ({'use_sim_time': 'true'}, ('use_sim_time', '/clock')),
        ({'composed': 'true', 'planner': 'false'}, ('composed', 'planner:=true')),
        ({'sim': 'false'}, ('params_file:=FILE', 'robot:=NAME')),
    ],
)
def test_what_cannot_be_meant_is_refused_and_names_the_argument(launch_file, given, words):
    with pytest.raises(ValueError) as refused:  # noqa: PT011, its words are looked at
        started(launch_file, **given)
    assert all(word in str(refused.value) for word in words), refused.value


@pytest.mark.parametrize('package', ['robot_state_publisher', 'rviz2'])
def test_nothing_is_started_without_a_package_that_is_needed(launch_file, package):
    launch_file.get_package_prefix = dict.fromkeys(
        {'robot_state_publisher', 'rviz2'} - {package}
    ).pop
    with pytest.raises(ValueError, match=f'^{package} is missing; expected: sudo apt install ros-'):
        started(launch_file, rviz='true')
    assert started(launch_file, sim='false', robot='fr3').keys() == {'controller', 'planner'}


def test_a_misspelt_argument_is_refused_and_one_of_another_launch_file_is_not(launch_file):
    started(launch_file, limit_scale='0.2', robot_ip='10.0.0.1')
    with pytest.raises(ValueError, match='limit_scal: no such argument; is limit_scale meant'):
        started(launch_file, limit_scal='0.2')


def test_a_file_that_sets_nothing_for_nodes_is_refused(launch_file, tmp_path):
    file = tmp_path / 'mine.yaml'
    file.write_text('- law\n')
    with pytest.raises(ValueError, match='has no ros__parameters'):
        started(launch_file, params_file=str(file))


def test_composed_is_one_process_whose_nodes_keep_their_names(launch_file):
    nodes = started(launch_file, composed='true', law='minimum_velocity', task='table')
    assert nodes.keys() == {'composed', 'robot_state_publisher'}
    composed = nodes['composed']
    assert composed.name is None
    assert composed.parameters[1] == {'law': 'minimum_velocity', 'task': 'table'}
    assert not composed.arguments


def test_all_take_their_time_from_clock_if_the_file_or_the_argument_says_so(launch_file):
    file = str(share_path('config/robots/mujoco_ros2_control.yaml'))
    nodes = started(launch_file, sim='false', params_file=file, rviz='true')
    assert nodes['controller'].parameters == [file, {}]
    assert nodes['rviz2'].parameters == [{'use_sim_time': True}]
    nodes = started(launch_file, sim='false', params_file=file, use_sim_time='false', rviz='true')
    assert nodes['controller'].parameters[1] == {'use_sim_time': False}
    assert nodes['rviz2'].parameters == [{'use_sim_time': False}]


def test_states_of_another_topic_reach_all_that_listen_to_them(launch_file):
    nodes = started(launch_file, states='franka/joint_states')
    for node in nodes.values():
        assert ('joint_states', 'franka/joint_states') in node.remappings


def test_rviz_looks_from_the_root_link_of_any_arm(launch_file, tmp_path):
    assert started(launch_file, rviz='true')['rviz2'].arguments[-2:] == ['-f', 'world']
    urdf = tmp_path / 'mine.urdf'
    urdf.write_text(find_arm('planar4r').description().replace('"world"', '"table"'))
    rviz = started(launch_file, rviz='true', robot=str(urdf))['rviz2']
    assert rviz.arguments[-2:] == ['-f', 'table']
    # The driver of a robot knows, and RViz can be set by hand.
    rviz = started(launch_file, robot='fr3', rviz='true', sim='false')['rviz2']
    assert '-f' not in rviz.arguments


def test_frames_of_a_robot_in_a_namespace_are_apart_from_those_of_another(launch_file):
    apart = [('/tf', 'tf'), ('/tf_static', 'tf_static')]
    left = started(launch_file, rviz='true', namespace='left')
    assert left['rviz2'].remappings == apart
    assert set(apart) <= set(left['robot_state_publisher'].remappings)
    alone = started(launch_file, rviz='true')
    assert alone['rviz2'].remappings == []
    assert not set(apart) & set(alone['robot_state_publisher'].remappings)


def test_rviz_shows_topics_that_the_nodes_publish() -> None:
    config = yaml.safe_load((ROOT / 'config' / 'redres.rviz').read_text(encoding='utf-8'))
    topics = {
        display[key]['Value']
        for display in config['Visualization Manager']['Displays']
        for key in ('Topic', 'Description Topic')
        if key in display
    }
    assert topics == {'robot_description', 'markers', 'controller/tip_pose', 'wrench'}


def test_ros_itself_makes_the_same_processes() -> None:
    pytest.importorskip('launch_ros.actions', reason='needs launch and launch_ros of ROS 2')
    from launch import LaunchContext
    from launch.launch_description_sources import PythonLaunchDescriptionSource

    context = LaunchContext()
    source = PythonLaunchDescriptionSource(str(FILE))
    *arguments, start = source.get_launch_description(context).entities
    for argument in arguments:
        argument.execute(context)
    made = {(node.node_package, node.node_executable) for node in start.execute(context)}
    ours = {('redres_ros', name) for name in OURS}
    assert made == ours | {('robot_state_publisher', 'robot_state_publisher')}
