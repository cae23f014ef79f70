"""The package as its users get it: built by colcon, and as a wheel for pip."""

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from configparser import ConfigParser
from importlib.metadata import EntryPoint
from pathlib import Path
from xml.etree import ElementTree

import pytest

pytestmark = pytest.mark.nightly

ROOT = Path(__file__).resolve().parents[1]
# All that a build reads: the rest of a checkout may be large (virtual environments, results).
PARTS = (
    'setup.py',
    'pyproject.toml',
    'package.xml',
    'resource',
    'config',
    'launch',
    'scripts',
    'redres_ros',
)
NODES = ('composed', 'controller', 'planner', 'sim')
PROBE = """import sys


def main():
    print('{name}', sys.executable, __file__, *sys.argv[1:], sep='\\n')
"""
FLAGS = ['--ros-args', '-p', 'words:=two words']
NO_COLCON = importlib.util.find_spec('colcon_core') is None

needs_colcon = pytest.mark.skipif(
    NO_COLCON, reason="no colcon in this environment: pip install '.[test]' brings it"
)


@pytest.fixture(scope='module')
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the project, so that building leaves nothing in the checkout; its nodes only print
    their names.
    """
    copy = tmp_path_factory.mktemp('packaging') / 'redres_ros'
    copy.mkdir()
    for part in PARTS:
        if (ROOT / part).is_dir():
            shutil.copytree(ROOT / part, copy / part, ignore=shutil.ignore_patterns('__pycache__'))
        else:
            shutil.copy(ROOT / part, copy / part)
    for name in NODES:
        (copy / 'redres_ros' / 'nodes' / f'{name}.py').write_text(PROBE.format(name=name))
    return copy


@pytest.fixture(scope='module', params=['install', 'symlink-install'])
def colcon_prefix(request: pytest.FixtureRequest, source: Path) -> Path:
    """install/redres_ros of a colcon workspace, built in either of colcon's two ways."""
    workspace = source.parent / request.param
    folders = ['--build-base', workspace / 'build', '--install-base', workspace / 'install']
    options = ['--symlink-install'] if request.param == 'symlink-install' else []
    colcon(workspace, 'build', '--base-paths', source, *folders, *options)
    return workspace / 'install' / 'redres_ros'


@pytest.fixture(scope='module')
def pip_prefix(source: Path) -> Path:
    """The prefix into which pip has installed the package's wheel, as `pip install .` does with an
    environment's.
    """
    copy, wheels, prefix = (source.parent / name for name in ('for_pip', 'wheels', 'prefix'))
    shutil.copytree(source, copy)
    pip = [sys.executable, '-m', 'pip']
    # Without isolation and dependencies nothing is downloaded: this takes seconds, and works
    # offline.
    run(*pip, 'wheel', '-q', '--no-deps', '--no-build-isolation', '-w', wheels, copy)
    run(
        *pip,
        'install',
        '-q',
        '--no-deps',
        '--ignore-installed',
        '--prefix',
        prefix,
        *wheels.glob('*.whl'),
    )
    return prefix


@needs_colcon
def test_colcon_takes_the_package_for_ament_python(source):
    name, _, kind = colcon(source.parent, 'list', '--base-paths', source).split()
    assert (name, kind) == ('redres_ros', '(ros.ament_python)')


@needs_colcon
@pytest.mark.parametrize('name', NODES)
def test_after_colcon_the_node_is_in_lib_and_runs_on_the_python_that_built_it(colcon_prefix, name):
    node = colcon_prefix / 'lib' / 'redres_ros' / name
    assert_executable(node)
    assert_ran(run_sourced(colcon_prefix, node, *FLAGS), name, colcon_prefix.parents[1])


@needs_colcon
def test_after_colcon_the_command_redres_is_on_the_path(colcon_prefix):
    assert run_sourced(colcon_prefix, 'which', 'redres').strip() == f'{colcon_prefix}/bin/redres'


@pytest.mark.parametrize('name', NODES)
def test_after_pip_the_node_is_in_lib_and_runs_on_its_environments_python(pip_prefix, name):
    node = pip_prefix / 'lib' / 'redres_ros' / name
    assert_executable(node)
    # An environment that is not activated: its bin/ is not on the PATH.
    said = run(node, *FLAGS, PATH='/usr/bin:/bin', PYTHONPATH=site_packages(pip_prefix))
    assert_ran(said, name, pip_prefix)


@needs_colcon
def test_colcon_installs_the_marker_and_every_share_file(colcon_prefix):
    assert_share_files(colcon_prefix)


def test_pip_installs_the_marker_and_every_share_file(pip_prefix):
    assert_share_files(pip_prefix)


def test_pip_installs_every_robot_description(pip_prefix):
    robots = Path('redres_ros', 'robots')
    wanted = {path.name for path in (ROOT / robots).glob('*.urdf')}
    assert wanted
    assert {path.name for path in (site_packages(pip_prefix) / robots).glob('*.urdf')} == wanted


def test_pip_informs_type_checkers_that_the_package_has_types(pip_prefix):
    assert (site_packages(pip_prefix) / 'redres_ros' / 'py.typed').is_file()


def test_pip_puts_only_names_that_begin_with_redres_into_the_shared_bin(pip_prefix):
    assert {path.name for path in (pip_prefix / 'bin').iterdir()} == {
        'redres',
        *(f'redres_{name}' for name in NODES),
    }


def test_every_console_script_names_a_function_that_exists(pip_prefix):
    declared = ConfigParser()
    declared.read(metadata(pip_prefix, 'entry_points.txt'))
    for name, value in declared['console_scripts'].items():
        assert callable(EntryPoint(name, value, 'console_scripts').load())


def test_setup_py_and_package_xml_say_the_same(pip_prefix):
    package = ElementTree.parse(ROOT / 'package.xml').getroot()
    wheel = dict(
        re.findall(
            r'^([A-Z][\w-]+): (.*)$', metadata(pip_prefix, 'METADATA').read_text(), re.MULTILINE
        )
    )
    assert wheel['Name'] == package.findtext('name')
    assert wheel['Version'] == package.findtext('version')
    assert wheel['Summary'] == package.findtext('description')
    assert wheel['License'] == package.findtext('license')
    assert wheel['Maintainer'] == package.findtext('maintainer')
    assert wheel['Maintainer-email'] == package.find('maintainer').get('email')


def assert_executable(path: Path) -> None:
    assert path.is_file() and os.access(path, os.X_OK), f'{path} is missing or not executable'


def assert_ran(said: str, name: str, folder: Path) -> None:
    """The probe of that name ran on this Python, from inside the folder, with FLAGS unchanged."""
    who, python, module, *arguments = said.splitlines()
    assert (who, python, arguments) == (name, sys.executable, FLAGS)
    assert Path(module).is_relative_to(folder)


def assert_share_files(prefix: Path) -> None:
    assert (
        prefix / 'share' / 'ament_index' / 'resource_index' / 'packages' / 'redres_ros'
    ).is_file()
    files = [
        ROOT / 'package.xml',
        *filter(Path.is_file, (ROOT / 'config').rglob('*')),
        *(ROOT / 'launch').rglob('*.py'),
    ]
    assert len(files) > 2
    for file in files:
        installed = prefix / 'share' / 'redres_ros' / file.relative_to(ROOT)
        assert installed.read_bytes() == file.read_bytes()


def site_packages(prefix: Path) -> Path:
    [folder] = prefix.glob('lib/python3*/site-packages')
    return folder


def metadata(prefix: Path, name: str) -> Path:
    [file] = site_packages(prefix).glob(f'redres_ros-*.dist-info/{name}')
    return file


def colcon(workspace: Path, *arguments: object) -> str:
    """What a colcon verb prints; it sees none of the user's own settings, and its logs go into the
    workspace.
    """
    code = 'import sys; from colcon_core.command import main; sys.exit(main())'
    return run(
        sys.executable,
        '-c',
        code,
        '--log-base',
        workspace / 'log',
        *arguments,
        COLCON_HOME=workspace,
    )


def run_sourced(colcon_prefix: Path, *command: object) -> str:
    """What the command prints in a shell that has sourced the package, as install/setup.bash does
    for a workspace.
    """
    return run(
        'bash', '-c', '. "$0/share/redres_ros/package.bash" && exec "$@"', colcon_prefix, *command
    )


def run(*command: object, **variables: object) -> str:
    """What the command prints, with these environment variables changed. Fails, and shows all
    output, if it fails.
    """
    environment = os.environ | {name: str(value) for name, value in variables.items()}
    done = subprocess.run(
        list(map(str, command)),
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, (
        f'{command} ended with {done.returncode}:\n{done.stdout}{done.stderr}'
    )
    return done.stdout
