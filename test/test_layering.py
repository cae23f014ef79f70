"""Who may import whom."""

import ast
import re
import sys
from collections.abc import Iterator

from imports import PACKAGE, ROS, WITH_ROS, Import, files_with, imports, subpackage

import redres_ros

# From the bottom up. A module imports from layers below its own, and from its own subpackage.
LAYERS = (
    {'errors'},
    {'types'},
    {'files'},
    {'kernels'},
    {'geometry'},
    {'parameter', 'robots', 'preview'},
    {'resolution', 'robot_model'},
    {'solver'},
    {'laws', 'tasks', 'preferences'},
    {'singularity'},
    {'limits'},
    {'policy', 'command'},
    {'controller', 'contact', 'fake_robot'},
    {'loop'},
    {'planning'},
    {'simulation'},
    {'nodes', 'paper'},
    {'graph'},
    {'preflight', 'demo', 'view'},
    {'cli'},
)


def level(name: str) -> int:
    levels = [number for number, layer in enumerate(LAYERS) if subpackage(name) in layer]
    assert levels, f'{name} is in no layer: add it to LAYERS'
    return levels[0]


def own_imports() -> Iterator[tuple[str, str]]:
    """Pairs (importing file, imported subpackage)."""
    for file, module, _ in imports():
        if module.startswith('redres_ros.') and file != '__init__.py':
            yield file, subpackage(module)


def test_imports_are_found():
    assert Import('controller.py', 'numpy', True) in imports()


def test_libraries_are_imported_where_they_belong():
    places = {
        'pinocchio': {'contact', 'geometry', 'robots', 'robot_model', 'view'},
        'mujoco': {'fake_robot'},
        'viser': {'view'},
        'numba': {'kernels'},
    }
    for library, allowed in places.items():
        assert {subpackage(file) for file in files_with(library)} <= allowed, library


def test_only_nodes_and_what_runs_them_import_ros_when_they_are_loaded():
    loading = {
        found.file for found in imports() if found.on_loading and re.fullmatch(ROS, found.library)
    }
    assert {subpackage(file) for file in loading} == WITH_ROS


def test_only_nodes_and_the_command_line_import_ros_at_all():
    assert {subpackage(file) for file in files_with(ROS)} - WITH_ROS <= {'cli'}


def test_resolution_needs_nothing_but_numpy_and_the_compiled_formulas():
    modules = {found.module for found in imports() if found.file == 'resolution.py'}
    own = {'redres_ros.errors', 'redres_ros.kernels.closed_form', 'redres_ros.types'}
    allowed = {'numpy', 'math', 'itertools', 'collections.abc', 'dataclasses', 'typing'}
    assert modules - own <= allowed


def test_compiled_formulas_need_nothing_but_numpy_and_numba():
    formulas = [
        found
        for found in imports()
        if subpackage(found.file) == 'kernels' and found.file != 'kernels/compiled.py'
    ]
    own = {found.module for found in formulas if subpackage(found.module) == 'kernels'}
    assert own == {'redres_ros.kernels.compiled'}  # numba's cache looks at a kernel's own file
    libraries = {'typing', 'numpy', 'numba', 'kernels'}
    assert {subpackage(found.module) for found in formulas} <= libraries


def test_compiled_formulas_are_declared_in_one_subpackage():
    declaring = {found.file for found in imports() if found.module == 'redres_ros.kernels.compiled'}
    assert {subpackage(file) for file in declaring} == {'kernels'}


def test_the_command_line_loads_nothing_but_errors_before_it_knows_what_to_do():
    loading = {
        found.module
        for found in imports()
        if subpackage(found.file) == 'cli' and found.on_loading and 'motion' not in found.file
    }
    own = {module for module in loading if module.startswith('redres_ros')}
    assert {module for module in own if subpackage(module) != 'cli'} == {'redres_ros.errors'}
    assert all(module.partition('.')[0] in sys.stdlib_module_names for module in loading - own)


def test_imports_point_downward():
    upward = [
        (file, target)
        for file, target in own_imports()
        if subpackage(file) != target and level(target) >= level(file)
    ]
    assert upward == []


def test_the_fake_robot_is_independent_of_what_it_tests():
    own = {target for file, target in own_imports() if subpackage(file) == 'fake_robot'}
    assert own <= {'fake_robot', 'errors', 'parameter', 'robots', 'types'}


def test_no_file_but_the_table_names_a_law():
    places = ('controller.py', 'nodes/*.py', 'fake_robot/*.py', 'simulation/closed_loop.py')
    for path in (path for place in places for path in PACKAGE.glob(place)):
        compared = [
            node
            for node in ast.walk(ast.parse(path.read_text(encoding='utf-8')))
            if isinstance(node, ast.Compare)
        ]
        words = {getattr(child, 'value', '') for node in compared for child in ast.walk(node)}
        assert words.isdisjoint(redres_ros.LAWS), path
