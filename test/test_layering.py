"""Who may import whom, read from the sources; and the core at work where there is no ROS at all."""

import ast
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

import redres_ros

PACKAGE = Path(redres_ros.__file__).parent
ROS = r'(rcl|rpy|ros|rmw|ament|launch|tf2|unique_identifier)\w*|\w+_(msgs|srvs|interfaces)'

# From the bottom up. A module imports from layers below its own, and from its own room.
LAYERS = (
    {'errors'},
    {'parameter', 'share', 'yaml_file', 'resolution', 'robots', 'cycles'},
    {'robot_model', 'waypoints'},
    {'laws', 'planner', 'playout'},
    {'controller', 'fri'},
    {'following'},
    {'simulation'},
    {'nodes', 'paper'},
    {'demo'},
    {'bench'},
    {'cli'},
)


class Import(NamedTuple):
    """The importing file, relative to the package; the module imported; whether it happens when the
    file is loaded.
    """

    file: str
    module: str
    on_loading: bool

    @property
    def library(self) -> str:
        return self.module.partition('.')[0]


def imports_of(path: Path) -> Iterator[Import]:
    tree = ast.parse(path.read_text(encoding='utf-8'))
    file = path.relative_to(PACKAGE).as_posix()
    inside = {
        child
        for node in ast.walk(tree)
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda))
        or (isinstance(node, ast.If) and ast.unparse(node.test) == 'TYPE_CHECKING')
        for child in ast.walk(node)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (Import(file, alias.name, node not in inside) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            module = node.module or ''
            if node.level:  # relative: none is in use, but it would count
                parts = ('redres_ros', *Path(file).parts)
                module = '.'.join((*parts[: len(parts) - node.level], *filter(None, (module,))))
            # `from redres_ros import laws` imports the module laws
            modules = (
                [f'{module}.{alias.name}' for alias in node.names]
                if module == 'redres_ros'
                else [module]
            )
            yield from (Import(file, name, node not in inside) for name in modules)


IMPORTS = [found for path in sorted(PACKAGE.rglob('*.py')) for found in imports_of(path)]


def files_with(library: str) -> set[str]:
    return {found.file for found in IMPORTS if re.fullmatch(library, found.library)}


def room(name: str) -> str:
    """Of a file or module of the package: 'laws' for laws/law.py and redres_ros.laws.law."""
    return name.removeprefix('redres_ros.').split('.')[0].split('/')[0]


def level(name: str) -> int:
    levels = [number for number, layer in enumerate(LAYERS) if room(name) in layer]
    assert levels, f'{name} is in no layer: add its room to LAYERS'
    return levels[0]


def own_imports(where: str = '') -> Iterator[tuple[str, str]]:
    """Pairs (importing file, room imported) within the package, for files in that room or in all of
    them.
    """
    for file, module, _ in IMPORTS:
        if module.startswith('redres_ros.') and file != '__init__.py' and where in ('', room(file)):
            yield file, room(module)


# --- libraries ------------------------------------------------------------------------------------


def test_all_files_were_read():
    assert len({found.file for found in IMPORTS}) > 20
    assert Import('controller.py', 'numpy', True) in IMPORTS


# What others' inverse kinematics cost must not depend on our wrappers, so the peers have the two
# libraries bare.
PEERS = 'bench/peers.py'

WITH_ROS = {'nodes', 'demo', 'bench'}  # rooms


def test_only_the_robot_model_and_the_peers_import_pinocchio():
    assert files_with('pinocchio') == {'robot_model.py', PEERS}


def test_only_the_plant_its_pictures_and_the_peers_import_mujoco():
    assert {'fri/plant.py'} <= files_with('mujoco') <= {'fri/plant.py', 'fri/render.py', PEERS}


def test_what_is_not_required_is_imported_when_it_is_asked_for():
    others = ('embodik', 'pink', 'mink')
    assert not any(found.on_loading for found in IMPORTS if found.library in others)
    assert {other: files_with(other) for other in others} == {other: {PEERS} for other in others}


def test_only_nodes_and_what_runs_them_import_ros_when_they_are_loaded():
    loading = {
        found.file for found in IMPORTS if found.on_loading and re.fullmatch(ROS, found.library)
    }
    assert {room(file) for file in loading} == WITH_ROS


def test_only_nodes_and_the_command_line_import_ros_at_all():
    assert {room(file) for file in files_with(ROS)} - WITH_ROS <= {'cli'}


def test_resolution_needs_nothing_but_numpy_and_lapack():
    modules = {found.module for found in IMPORTS if found.file == 'resolution.py'}
    assert modules == {'math', 'numpy', 'scipy.linalg.lapack', 'redres_ros.errors'}


def test_the_command_line_loads_nothing_but_errors_before_it_knows_what_to_do():
    loading = {found.module for found in IMPORTS if room(found.file) == 'cli' and found.on_loading}
    own = {module for module in loading if module.startswith('redres_ros')}
    assert {module for module in own if room(module) != 'cli'} == {'redres_ros.errors'}
    assert all(module.partition('.')[0] in sys.stdlib_module_names for module in loading - own)


# --- rooms ----------------------------------------------------------------------------------------


def test_imports_point_downward():
    upward = [
        (file, target)
        for file, target in own_imports()
        if room(file) != target and level(target) >= level(file)
    ]
    assert upward == []


def test_the_fake_robot_is_an_independent_witness():
    assert {target for _, target in own_imports('fri')} <= {'fri', 'errors', 'parameter', 'robots'}


def test_laws_know_the_state_and_nothing_of_who_runs_them():
    assert {target for _, target in own_imports('laws')} <= {
        'laws',
        'robot_model',
        'resolution',
        'parameter',
        'errors',
    }


def test_no_file_but_the_table_names_a_law():
    for path in sorted(PACKAGE.rglob('*.py')):
        if (
            room(path.relative_to(PACKAGE).as_posix()) in ('controller', 'nodes', 'fri')
            or path.stem == 'closed_loop'
        ):
            tree = ast.parse(path.read_text(encoding='utf-8'))
            compared = [node for node in ast.walk(tree) if isinstance(node, ast.Compare)]
            words = {
                child.value
                for node in compared
                for child in ast.walk(node)
                if isinstance(child, ast.Constant)
            }
            assert not words & set(redres_ros.LAWS), path


# --- without ROS ----------------------------------------------------------------------------------

BLOCKED = f"""
import importlib.abc, importlib.util, re, sys

class Block(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if re.fullmatch({ROS!r}, name.partition('.')[0]):
            raise ModuleNotFoundError(f'blocked: {{name}}', name=name)

sys.meta_path.insert(0, Block())
"""


def run_blocked(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    paths = filter(None, (str(PACKAGE.parent), os.environ.get('PYTHONPATH')))
    environment = os.environ | {'PYTHONPATH': os.pathsep.join(paths)}
    return subprocess.run(
        [sys.executable, '-c', BLOCKED + code, *arguments],
        env=environment,
        check=False,
        capture_output=True,
        text=True,
        timeout=120,
    )


def test_the_block_blocks():
    assert 'blocked: rclpy' in run_blocked('import rclpy').stderr
    assert 'blocked: sensor_msgs' in run_blocked('from sensor_msgs.msg import JointState').stderr


def test_the_core_loads_without_ros():
    modules = {
        found.file.removesuffix('.py').removesuffix('/__init__').replace('/', '.')
        for found in IMPORTS
        if room(found.file) not in (*WITH_ROS, '__init__.py')
    }
    result = run_blocked('\n'.join(f'import redres_ros.{module}' for module in sorted(modules)))
    assert result.returncode == 0, result.stderr


def test_a_simulation_runs_without_ros(tmp_path):
    task = tmp_path / 'short.yaml'
    task.write_text(
        'robot: lwr4_paper\nstart: [28.08, 104.12, 114.59, 94.85, 14.32, -28.12, 0.0]\n'
        'waypoints: [[-0.4, 0.36, 0.01], [-0.4, 0.35, 0.01]]\nsegment_time: 0.1\n'
    )
    result = run_blocked(
        'from redres_ros.cli import main\nsys.exit(main(sys.argv[1:]))',
        'simulate',
        '--task',
        str(task),
        '--law',
        'dynamically_consistent',
    )
    assert result.returncode == 0, result.stderr
    assert 'reached the last point' in result.stdout


@pytest.mark.parametrize('command', ['demo', 'watch', 'bench'])
def test_what_needs_ros_says_how_to_get_it(command, tmp_path):
    out = [] if command == 'watch' else ['--out', str(tmp_path)]
    result = run_blocked(
        'from redres_ros.cli import main\nsys.exit(main(sys.argv[1:]))', command, *out
    )
    assert result.returncode == 1
    assert 'pip install' in result.stderr
    assert 'Traceback' not in result.stderr


def test_the_package_offers_what_it_names():
    assert {name: getattr(redres_ros, name) for name in redres_ros.__all__}.keys() == set(
        redres_ros._HOMES
    )
    with pytest.raises(AttributeError, match='no attribute'):
        redres_ros.nothing  # noqa: B018


def test_a_researchers_controller_costs_no_simulator_no_plots_and_no_ros():
    program = """
import sys
from redres_ros import Controller, RobotModel, make_law
Controller(RobotModel.named('lwr4_paper'), make_law('dynamically_consistent'), 0.001)
print(*{module.partition('.')[0] for module in sys.modules})
"""
    done = run_blocked(program)
    assert done.returncode == 0, done.stderr
    loaded = set(done.stdout.split())
    assert {'numpy', 'pinocchio'} <= loaded
    assert not loaded & {'mujoco', 'matplotlib', 'rich', 'numba', 'rclpy'}


HELP = """
import sys
from redres_ros.cli import main

try:
    main(['--help'])
except SystemExit:
    pass
heavy = {'numpy', 'pinocchio', 'mujoco', 'rclpy', 'matplotlib'}
print(*heavy & set(sys.modules), file=sys.stderr)
"""


def test_help_loads_nothing_heavy():
    done = subprocess.run([sys.executable, '-c', HELP], capture_output=True, text=True, check=True)
    assert done.stderr.strip() == ''
    assert 'COMMAND' in done.stdout
