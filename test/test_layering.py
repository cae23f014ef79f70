"""Who may import whom."""

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

from imports import PACKAGE, ROS, WITH_ROS, Import, files_with, imports, subpackage

import redres_ros

# From the bottom up. A module imports from layers below its own, and from its own subpackage.
LAYERS = (
    {'errors'},
    {'types'},
    {'files'},
    {'kernels'},
    {'geometry'},
    {'parameter', 'robots'},
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


def own_imports(where: str = '') -> Iterator[tuple[str, str]]:
    """Pairs (importing file, imported subpackage), for the files of one subpackage or of all."""
    for file, module, _ in imports():
        if (
            module.startswith('redres_ros.')
            and file != '__init__.py'
            and where in ('', subpackage(file))
        ):
            yield file, subpackage(module)


# --- libraries ------------------------------------------------------------------------------------


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


AROUND_THEM = ('compiled',)


def test_resolution_needs_nothing_but_numpy_and_the_compiled_formulas():
    modules = {found.module for found in imports() if found.file == 'resolution.py'}
    own = {'redres_ros.errors', 'redres_ros.kernels.closed_form', 'redres_ros.types'}
    allowed = {'numpy', 'math', 'itertools', 'collections.abc', 'dataclasses', 'typing'}
    assert modules - own <= allowed


def test_compiled_formulas_need_nothing_but_numpy_and_numba():
    formulas = [found for found in imports() if subpackage(found.file) == 'kernels']
    formulas = [found for found in formulas if Path(found.file).stem not in AROUND_THEM]
    own = {found.module for found in formulas if subpackage(found.module) == 'kernels'}
    assert own == {'redres_ros.kernels.compiled'}  # numba's cache looks at a kernel's own file
    assert {subpackage(found.module) for found in formulas} <= {
        'typing',
        'numpy',
        'numba',
        'kernels',
    }


def test_compiled_formulas_are_declared_in_one_subpackage():
    assert {
        subpackage(found.file)
        for found in imports()
        if found.module == 'redres_ros.kernels.compiled' and subpackage(found.file) != 'kernels'
    } == set()


def test_the_command_line_loads_nothing_but_errors_before_it_knows_what_to_do():
    loading = {
        found.module
        for found in imports()
        if subpackage(found.file) == 'cli' and found.on_loading and 'motion' not in found.file
    }
    own = {module for module in loading if module.startswith('redres_ros')}
    assert {module for module in own if subpackage(module) != 'cli'} == {'redres_ros.errors'}
    assert all(module.partition('.')[0] in sys.stdlib_module_names for module in loading - own)


# --- layers ---------------------------------------------------------------------------------------


def test_imports_point_downward():
    upward = [
        (file, target)
        for file, target in own_imports()
        if subpackage(file) != target and level(target) >= level(file)
    ]
    assert upward == []


def test_the_fake_robot_is_independent_of_what_it_tests():
    assert {target for _, target in own_imports('fake_robot')} <= {
        'fake_robot',
        'errors',
        'parameter',
        'robots',
        'types',
    }


def test_no_file_but_the_table_names_a_law():
    for path in sorted(PACKAGE.rglob('*.py')):
        if (
            subpackage(path.relative_to(PACKAGE).as_posix())
            in ('controller', 'nodes', 'fake_robot')
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
