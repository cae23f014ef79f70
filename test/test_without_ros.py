"""The core at work where there is no ROS at all, and what it costs to load."""

import os
import subprocess

import pytest
from imports import PACKAGE, ROS
from nightly import by_day
from programs import run_python

import redres_ros

pytestmark = pytest.mark.slow

TOOLS = 'mujoco|matplotlib'  # of the extra [tools]
REDRES = 'from redres_ros.cli import main; sys.exit(main(sys.argv[1:]))'

BLOCK = """
import importlib.abc, re, sys

blocked = sys.argv.pop(1)

class Block(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if re.fullmatch(blocked, name.partition('.')[0]):
            raise ModuleNotFoundError(f'blocked: {name}', name=name)

sys.meta_path.insert(0, Block())
"""


def run_blocked(
    code: str, *arguments: str, libraries: str = ROS
) -> subprocess.CompletedProcess[str]:
    """A program that cannot import these libraries, a regular expression."""
    paths = filter(None, (str(PACKAGE.parent), os.environ.get('PYTHONPATH')))
    environment = os.environ | {'PYTHONPATH': os.pathsep.join(paths)}
    return run_python('-c', BLOCK + code, libraries, *arguments, env=environment)


def test_a_pinocchio_that_is_too_old_is_named_in_one_line():
    old = "import pinocchio as pin; pin.__version__ = '2.7.0'; del pin.Model.armature\n"
    result = run_blocked(old + REDRES, 'simulate')
    assert result.returncode == 1
    [line] = result.stderr.splitlines()
    assert line.startswith('redres simulate: got Pinocchio 2.7.0 in')
    assert 'allowed: 3.3.1 or newer' in line


@pytest.mark.parametrize('libraries', [ROS, TOOLS], ids=['ros', 'tools'])
def test_a_simulation_runs_without(libraries, tmp_path):
    task = tmp_path / 'short.yaml'
    task.write_text(
        'robot: lwr4_paper\nstart: [28.08, 104.12, 114.59, 94.85, 14.32, -28.12, 0.0]\n'
        'waypoints: [[-0.4, 0.36, 0.01], [-0.4, 0.35, 0.01]]\nsegment_time: 0.1\n'
    )
    options = ('--task', str(task), '--law', 'dynamically_consistent')
    result = run_blocked(REDRES, 'simulate', *options, libraries=libraries)
    assert result.returncode == 0, result.stderr
    assert 'reached the last point' in result.stdout


@pytest.mark.parametrize('command', by_day(1, ['demo', 'watch']))
def test_what_needs_ros_says_how_to_get_it(command, tmp_path):
    out = [] if command == 'watch' else ['--out', str(tmp_path)]
    result = run_blocked(REDRES, command, *out)
    assert result.returncode == 1
    assert 'pip install' in result.stderr
    assert 'Traceback' not in result.stderr


def test_the_package_offers_what_it_names():
    found = {name: getattr(redres_ros, name) for name in redres_ros.__all__}
    assert found.keys() == set(redres_ros._HOMES)
    assert all(hasattr(redres_ros, name) for name in dir(redres_ros))
    assert {'run', 'param', 'load_task', 'Recording'} <= set(dir(redres_ros))
    with pytest.raises(AttributeError, match='no attribute'):
        redres_ros.nothing  # noqa: B018


CONTROLLER = """
import sys
from redres_ros import Controller, RobotModel, make_law
Controller(RobotModel.named('lwr4_paper'), make_law('dynamically_consistent'), 0.001)
"""
LOADED = "print(*{module.partition('.')[0] for module in sys.modules}, file=sys.stderr)"


def test_a_controller_loads_nothing_that_it_does_not_need() -> None:
    done = run_blocked(CONTROLLER + LOADED)
    assert done.returncode == 0, done.stderr
    assert not set(done.stderr.split()) & {'mujoco', 'matplotlib', 'rclpy', 'rich'}


def test_the_fake_robot_starts_without_the_formulas_of_the_controller() -> None:
    done = run_blocked('import redres_ros.nodes.sim', libraries='numba')
    assert done.returncode == 0, done.stderr
