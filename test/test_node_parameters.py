"""Names and parameters of nodes, as files and command lines give them."""

import threading
from pathlib import Path
from typing import Any

import pytest
import yaml
from nightly import by_day
from programs import run_python

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from own_ros import ros
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import String
from virtual_graph import _Cycles, virtual_run

from redres_ros.files.installation import remedy
from redres_ros.laws import LAWS, law_name
from redres_ros.nodes.controller import ControllerNode
from redres_ros.nodes.parameters import ParameterError, warn_of_misspelt
from redres_ros.nodes.planner import PlannerNode
from redres_ros.nodes.runtime import own_domain
from redres_ros.nodes.sim import SimNode
from redres_ros.planning.task_executor import UNDER_WAY as STATES

pytestmark = pytest.mark.slow

UNDER_WAY = {state.value for state in STATES}
REFUSED = (
    ({'law': 'none'}, ('none', 'minimum_torque')),
    ({'law': 7}, ('STRING', 'INTEGER')),
    ({'law': 'minimum_velocity', 'damping': -1.0}, ('-1',)),
    ({'damping': 501.0}, ('501', '500')),
    ({'damping': float('nan')}, ('nan',)),
    ({'rate': 100.0}, ('rate',)),
    ({'limits': ['foo']}, ('foo', 'position')),
    ({'limits': ['none', 'position']}, ('none', 'expected names')),
    ({'limits': ['position', 'position']}, ('position', 'named twice')),
    ({'limit_scale': 2}, ('2', '1')),
    ({'task_gain': -1.0}, ('-1', '0')),
    ({'secondary_tasks': ['orientation@knee']}, ('knee', 'link_4')),
    ({'secondary_tasks': ['joint@a8']}, ('a8', 'lwr_a1_joint')),
)
OF_ROS = {'use_sim_time', 'start_type_description_service'}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / 'mine.yaml'


@pytest.mark.parametrize(('cls', 'most'), [(ControllerNode, 50), (PlannerNode, 12), (SimNode, 24)])
def test_no_node_gets_more_parameters(cls: Any, most: int) -> None:
    """A new one takes the place of another: `most` may only fall."""
    with ros():
        node = cls()
        names = set(node._parameters) - OF_ROS
        node.destroy_node()
    assert len(names) <= most


@pytest.mark.parametrize('cls', [ControllerNode, PlannerNode, SimNode])
def test_a_node_of_another_name_is_refused_since_others_use_it_in_topics(cls: Any) -> None:
    with ros('-r', '__node:=ctl'), pytest.raises(ParameterError, match="'ctl'; allowed: .*__ns"):
        cls()


def test_parameters_are_set_live_and_refused_with_a_reason() -> None:
    with ros():
        node = ControllerNode()
        for law in LAWS:
            assert set_in(node, {'law': law, 'damping': 20}) == ''
        assert law_name(node._controller.law) == law
        assert node._controller.law.damping == 20.0
        for values in (
            {'limits': 'none'},
            {'limits': ['velocity', 'torque'], 'limit_scale': 0.5},
            {'preferences': 'posture, joint_centering', 'posture.gain': 2},
            {'secondary_tasks': ['orientation'], 'task_gain': 5},
            {'max_linear': 1},
        ):
            assert set_in(node, values) == ''
        for values, words in REFUSED:
            reason = set_in(node, values)
            assert words and all(word in reason for word in words), reason
        assert law_name(node._controller.law) == law
        node.destroy_node()


@pytest.mark.parametrize(
    ('ignored', 'problem', 'mended'),
    [
        (
            {'scene.walls': 'inside_sphere 0 0 0 2'},
            'add workspace to the parameter limits',
            {'limits': ['position', 'workspace']},
        ),
        (
            {'preferences': 'posture', 'law': 'minimum_velocity'},
            'preferences have no effect: minimum_velocity',
            {'law': 'minimum_torque'},
        ),
    ],
)
def test_what_is_set_without_effect_is_reported(ignored, problem, mended) -> None:
    with ros():
        node = ControllerNode()
        assert set_in(node, ignored) == ''
        assert problem in node._policy.problem
        assert set_in(node, mended) == ''
        assert not node._policy.problem
        node.destroy_node()


def test_parameters_are_set_live_also_while_joints_are_steered() -> None:
    with ros():
        node = ControllerNode()
        node._controller.follow_joints(True)
        assert set_in(node, {'limit_scale': 0.1}) == ''
        node.destroy_node()


def set_in(node: Any, values: dict[str, Any]) -> str:
    """Set parameters at once, as by a service; why that was refused."""
    changes = [Parameter(name, value=value) for name, value in values.items()]
    return str(node.set_parameters_atomically(changes).reason)


def test_an_empty_list_of_names_means_none_at_the_start_and_live(file: Path) -> None:
    file.write_text('/**:\n  ros__parameters:\n    limits: []\n')
    with ros('--params-file', str(file)):
        node = ControllerNode()
        assert node.get_parameter('limits').value == ['none']
        empty = Parameter('preferences', Parameter.Type.BOOL_ARRAY, [])
        [result] = node.set_parameters([empty])
        assert result.successful, result.reason
        assert node.get_parameter('preferences').value == ['none']
        node.destroy_node()


def values_of(*arguments: str) -> dict[str, Any]:
    """All parameters of a controller, as `ros2 param dump` writes them."""
    with ros(*arguments):
        node = ControllerNode()
        values = {name: parameter.value for name, parameter in node._parameters.items()}
        node.destroy_node()
    plain = (bool, int, float, str)
    return {
        name: value if isinstance(value, plain) else list(value) for name, value in values.items()
    }


def test_parameters_that_are_dumped_load_again(file: Path) -> None:
    before = values_of()
    file.write_text(yaml.dump({'/**': {'ros__parameters': before}}))
    assert values_of('--params-file', str(file)) == before


def test_a_misspelt_parameter_is_reported_in_one_line_and_those_of_others_are_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    given = {'law': 'minimum_velocity', 'limit_scael': 0.5, 'camera.exposure': 3.0, 'other': 1.0}
    lines: list[str] = []
    with ros():
        overrides = [Parameter(name, value=value) for name, value in given.items()]
        node = Node('arm', parameter_overrides=overrides)
        node.declare_parameter('law', '')
        node.declare_parameter('limit_scale', 1.0)
        monkeypatch.setattr(node, 'get_logger', lambda: type('Log', (), {'warning': lines.append}))
        warn_of_misspelt([node])
        node.declare_parameter('limit_scael', 1.0)  # as another node of the process has it
        warn_of_misspelt([node])
        node.destroy_node()
    assert lines == ['no parameter limit_scael (is limit_scale meant?); it changes nothing']


def test_lockstep_alone_runs_a_task_and_nothing_is_wrong() -> None:
    alone = {'rate': 100.0, 'lockstep': True}
    states: list[str] = []
    stopped = threading.Event()

    def on_state(message: String) -> None:
        states.append(message.data)
        if message.data not in UNDER_WAY and len(states) > 1:
            stopped.set()

    with virtual_run(sim={**alone, 'plant': 'ideal'}, controller=alone, planner=alone) as run:
        run.graph.listen('planner/state', 'test', on_state)
        run.graph.clock.call_in(0.1, lambda: run.graph.call('planner/start'))
        run.nodes['sim'].run(stopped, _Cycles(run.graph.clock))
    assert states[-1] == 'finished', states
    assert not [line for _, line in run.graph.log if 'does not move' in line]


@pytest.mark.parametrize('name', by_day(1, ['sim', 'composed', 'controller', 'planner']))
def test_only_the_fake_robot_needs_mujoco_and_says_how_to_get_it(name: str) -> None:
    program = (
        "import sys; sys.modules['mujoco'] = None\n"
        'from redres_ros.nodes.entry import run_node\n'
        f"sys.exit(run_node('{name}', ['--ros-args', '-p', 'rate:=no']))"
    )
    with own_domain():
        done = run_python('-c', program)
    assert done.returncode == 1
    needs_it = name in ('sim', 'composed')
    expected = 'the package mujoco is not installed; install it with: pip install mujoco'
    assert (expected in done.stderr) is needs_it, done.stderr


def test_a_remedy_names_the_bare_package_where_ros_has_installed_this_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv('AMENT_PREFIX_PATH', raising=False)
    assert remedy('pinocchio') == 'pip install pin'
    marker = tmp_path / 'share/ament_index/resource_index/packages/redres_ros'
    marker.parent.mkdir(parents=True)
    marker.touch()
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path))
    assert remedy('viser') == 'pip install viser'
    assert remedy('pinocchio') == 'rosdep install --from-paths src --ignore-src'
