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

from redres_ros.files.share import share_path
from redres_ros.robots import find_arm

ROOT = Path(__file__).resolve().parents[1]
FILE = ROOT / 'launch' / 'redres.launch.py'
OURS = {'sim', 'controller', 'planner'}


class Recorded(SimpleNamespace):
    """An action that keeps what it was made with."""

    def __init__(self, name: str = '', **given: Any) -> None:
        super().__init__(name=name, **given)


class Configuration:
    """The value of an argument in the context, which here is a dict."""

    def __init__(self, name: str) -> None:
        self.name = name

    def perform(self, context: dict[str, str]) -> str:
        return context[self.name]


def stand_in() -> dict[str, ModuleType]:
    """Modules with the names of launch that the file uses."""
    names: dict[str, dict[str, Any]] = {
        'launch': {'LaunchContext': dict, 'LaunchDescription': list},
        'launch.actions': dict.fromkeys(
            ('DeclareLaunchArgument', 'OpaqueFunction', 'Shutdown'), Recorded
        ),
        'launch.substitutions': {'LaunchConfiguration': Configuration},
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
    """The launch file as a module."""
    for name, module in stand_in().items():
        monkeypatch.setitem(sys.modules, name, module)
    spec = importlib.util.spec_from_file_location('redres_launch', FILE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def started(launch_file: ModuleType, **given: str) -> dict[str, Recorded]:
    """The nodes that the arguments start, by executable."""
    defaults = {a.name: a.default_value for a in launch_file.generate_launch_description()[:-1]}
    assert given.keys() <= defaults.keys()
    nodes = launch_file.start_nodes({**defaults, **given})
    return {node.executable: node for node in nodes}


def test_by_default_the_fake_arm_its_controller_the_planner_and_the_frames_are_started(launch_file):
    nodes = started(launch_file)
    assert nodes.keys() == OURS | {'robot_state_publisher'}
    for name in OURS:
        file, values = nodes[name].parameters
        assert file == str(share_path('config/redres.yaml'))
        assert values == {'use_sim_time': False}  # what the file says is not hidden


def test_arguments_become_parameters_of_the_nodes_that_have_them(launch_file):
    nodes = started(
        launch_file,
        robot='fr3',
        law='minimum_velocity',
        limits='none',
        rate='250',
        namespace='left',
    )
    shared = {'robot': 'fr3', 'rate': 250.0, 'use_sim_time': False}
    assert nodes['sim'].parameters[1] == shared
    assert nodes['planner'].parameters[1] == shared
    own = {'law': 'minimum_velocity', 'limits': 'none'}
    assert nodes['controller'].parameters[1] == {**shared, **own}
    assert {node.namespace for node in nodes.values()} == {'left'}
    description = nodes['robot_state_publisher'].parameters[0]['robot_description']
    assert ElementTree.fromstring(description).get('name') == 'fr3'


def test_the_frames_are_those_of_the_arm_in_the_file_of_parameters(launch_file, tmp_path):
    file = tmp_path / 'mine.yaml'
    file.write_text('/**:\n  ros__parameters:\n    robot: fr3\n')
    publisher = started(launch_file, params_file=str(file))['robot_state_publisher']
    description = publisher.parameters[0]['robot_description']
    assert ElementTree.fromstring(description).get('name') == 'fr3'


def test_on_a_robot_only_what_it_lacks_is_started(launch_file):
    nodes = started(launch_file, sim='false', planner='false', rviz='true')
    assert nodes.keys() == {'controller', 'rviz2'}  # the driver publishes the frames
    assert started(launch_file, robot='topic', sim='false').keys() == {'controller', 'planner'}
    with pytest.raises(ValueError, match="got 'no'; allowed: true or false"):
        started(launch_file, sim='no')


def test_rviz_looks_from_the_root_link_of_any_arm(launch_file, tmp_path):
    assert started(launch_file, rviz='true')['rviz2'].arguments[-2:] == ['-f', 'world']
    urdf = tmp_path / 'mine.urdf'
    description = find_arm('planar4r').description()
    urdf.write_text(description.replace('"world"', '"table"'))
    rviz = started(launch_file, rviz='true', robot=str(urdf))['rviz2']
    assert rviz.arguments[-2:] == ['-f', 'table']
    # The driver of a robot knows, and RViz can be set by hand.
    assert '-f' not in started(launch_file, rviz='true', sim='false')['rviz2'].arguments


def test_frames_of_a_robot_in_a_namespace_are_apart_from_those_of_another(launch_file):
    apart = [('/tf', 'tf'), ('/tf_static', 'tf_static')]
    left = started(launch_file, rviz='true', namespace='left')
    assert left['robot_state_publisher'].remappings == left['rviz2'].remappings == apart
    alone = started(launch_file, rviz='true')
    assert alone['robot_state_publisher'].remappings == alone['rviz2'].remappings == []


def test_when_one_node_ends_so_do_the_others(launch_file):
    nodes = started(launch_file)
    assert all(nodes[name].on_exit.reason == f'{name} ended' for name in OURS)


def test_rviz_shows_topics_that_the_nodes_publish() -> None:
    config = yaml.safe_load((ROOT / 'config' / 'redres.rviz').read_text(encoding='utf-8'))
    displays = config['Visualization Manager']['Displays']
    topics = {
        display[key]['Value']
        for display in displays
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
