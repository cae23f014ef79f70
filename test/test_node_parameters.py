"""Names and parameters of nodes, as files and command lines give them."""

import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from nightly import by_day

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

import rclpy
from own_ros import ros
from rclpy.parameter import Parameter
from std_msgs.msg import String
from virtual_graph import _Cycles, virtual_run

from redres_ros.files.remedy import remedy
from redres_ros.nodes.controller import ControllerNode
from redres_ros.nodes.discovery import own_domain
from redres_ros.nodes.entry import run_node
from redres_ros.nodes.lifecycle import LifeError
from redres_ros.nodes.parameters import overruled
from redres_ros.nodes.planner import PlannerNode
from redres_ros.nodes.sim import SimNode
from redres_ros.planning.task_executor import UNDER_WAY as STATES

pytestmark = pytest.mark.slow

UNDER_WAY = {state.value for state in STATES}


def test_a_signal_ends_the_tests_and_not_ros_beneath_one() -> None:
    with ros():
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        time.sleep(0.5)  # in which rclpy's own handler, in a thread, would act
        assert rclpy.ok()


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A file of parameters, not yet written."""
    return tmp_path / 'mine.yaml'


@pytest.mark.parametrize('cls', [ControllerNode, PlannerNode, SimNode])
def test_a_node_of_another_name_is_refused_since_others_use_it_in_topics(cls: Any) -> None:
    with ros('-r', '__node:=ctl'), pytest.raises(LifeError, match="'ctl'; allowed: .*__ns"):
        cls()


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
    assert before['elbow_height.height'] == np.inf
    file.write_text(yaml.dump({'/**': {'ros__parameters': before}}))
    assert values_of('--params-file', str(file)) == before


@pytest.mark.parametrize(
    ('key', 'lost'), [('/**/controller', {'limit_scale'}), ('/**', set())], ids=str
)
def test_what_a_file_sets_in_spite_of_the_command_line_is_found(
    key: str, lost: set[str], file: Path
) -> None:
    of_all = '/**:\n  ros__parameters:\n    rate: 500.0\n'
    own = f'{key}:\n  ros__parameters:\n    limit_scale: 0.2\n'
    file.write_text(f'{of_all}{own}')
    arguments = ['--params-file', str(file), '-p', 'limit_scale:=0.5']
    with ros(*arguments):
        node = ControllerNode()
        assert overruled([node], arguments).keys() == lost
        node.destroy_node()


def test_lockstep_alone_runs_a_task_and_nothing_is_wrong() -> None:
    alone = {'rate': 100.0, 'lockstep': True}
    ideal = {**alone, 'plant': 'ideal'}
    states: list[str] = []
    stopped = threading.Event()

    def on_state(message: String) -> None:
        states.append(message.data)
        if message.data not in UNDER_WAY and len(states) > 1:
            stopped.set()

    with virtual_run(sim=ideal, controller=alone, planner={**alone, 'home_speed': 0.5}) as run:
        run.graph.listen('planner/state', 'test', on_state)
        run.graph.clock.call_in(0.1, lambda: run.graph.call('planner/start'))
        run.nodes['sim'].run(stopped, _Cycles(run.graph.clock))
    assert states[-1] == 'finished', states
    assert not [line for _, line in run.graph.log if 'does not move' in line]


@pytest.mark.parametrize('way', ['-p', '--params-file'])
def test_a_mistyped_law_is_refused_before_its_node_is_loaded(
    way: str, file: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    file.write_text('/**:\n  ros__parameters:\n    law: least\n')
    monkeypatch.setattr('redres_ros.nodes.entry.import_module', None)
    word = 'law:=least' if way == '-p' else str(file)
    assert run_node('controller', ['--ros-args', way, word]) == 1
    assert 'minimum_velocity' in capfd.readouterr().err


@pytest.mark.parametrize('name', by_day(1, ['sim', 'composed', 'controller', 'planner']))
def test_only_the_fake_robot_needs_mujoco_and_says_how_to_get_it(name: str) -> None:
    program = (
        "import sys; sys.modules['mujoco'] = None\n"
        'from redres_ros.nodes import entry\n'
        f"entry.{name}.__globals__['sys'].argv[1:] = ['--ros-args', '-p', 'rate:=no']\n"
        f'sys.exit(entry.{name}())'
    )
    with own_domain():
        done = subprocess.run(
            [sys.executable, '-c', program], capture_output=True, text=True, check=False
        )
    assert done.returncode == 1
    needs_it = name in ('sim', 'composed')
    expected = (
        "needs mujoco, which is not installed; install it with: pip install 'redres_ros[fake]'"
    )
    assert (expected in done.stderr) is needs_it, done.stderr


def test_a_remedy_names_the_bare_package_where_ros_has_installed_this_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv('AMENT_PREFIX_PATH', raising=False)
    assert remedy('view', 'viser') == "pip install 'redres_ros[view]'"
    marker = tmp_path / 'share/ament_index/resource_index/packages/redres_ros'
    marker.parent.mkdir(parents=True)
    marker.touch()
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path))
    assert remedy('bench', 'pink') == 'pip install pin-pink'
    assert remedy('ros', 'pinocchio') == 'rosdep install --from-paths src --ignore-src'
