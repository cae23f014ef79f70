"""The package as its users get it: built by colcon, and as a wheel for pip."""

import importlib.util
import os
import shutil
import subprocess
import sys
from importlib.metadata import distributions
from pathlib import Path

import pytest

pytestmark = pytest.mark.nightly

ROOT = Path(__file__).resolve().parents[1]
# All that a build reads: the rest of a checkout may be large (virtual environments, results).
PARTS = (
    *('setup.py', 'pyproject.toml', 'package.xml'),
    *('resource', 'config', 'launch', 'scripts', 'redres_ros'),
)
NODES = ('composed', 'controller', 'planner', 'sim')
PROBE = f"""import sys
from functools import partial


def probe(name):
    print(name, sys.executable, __file__, *sys.argv[1:], sep='\\n')


{', '.join(NODES)} = (partial(probe, name) for name in {NODES})
"""
FLAGS = ['--ros-args', '-p', 'words:=two words']

needs_colcon = pytest.mark.skipif(
    importlib.util.find_spec('colcon_core') is None,
    reason="no colcon in this environment: pip install '.[test]' brings it",
)


@pytest.fixture(scope='module')
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the project whose nodes only print their names."""
    copy = tmp_path_factory.mktemp('packaging') / 'redres_ros'
    copy.mkdir()
    for part in PARTS:
        if (ROOT / part).is_dir():
            shutil.copytree(ROOT / part, copy / part, ignore=shutil.ignore_patterns('__pycache__'))
        else:
            shutil.copy(ROOT / part, copy / part)
    (copy / 'redres_ros' / 'nodes' / 'entry.py').write_text(PROBE)
    return copy


@pytest.fixture(scope='module', params=[(), ('--symlink-install',)], ids=['copies', 'links'])
def colcon_prefix(request: pytest.FixtureRequest, source: Path) -> Path:
    """install/redres_ros of a colcon workspace, built in either of colcon's two ways."""
    workspace = source.parent / f'colcon{len(request.param)}'
    folders = ['--build-base', workspace / 'build', '--install-base', workspace / 'install']
    build = ['build', '--base-paths', source, *folders, *request.param]
    code = 'import sys; from colcon_core.command import main; sys.exit(main())'
    log = ['--log-base', workspace / 'log']  # settings and logs are the workspace's own
    run(sys.executable, '-c', code, *log, *build, COLCON_HOME=workspace)
    return workspace / 'install' / 'redres_ros'


@pytest.fixture(scope='module')
def pip_prefix(source: Path) -> Path:
    """The prefix into which pip has installed the package's wheel."""
    copy, wheels, prefix = (source.parent / name for name in ('for_pip', 'wheels', 'prefix'))
    shutil.copytree(source, copy)
    pip = [sys.executable, '-m', 'pip']
    # Without isolation and dependencies nothing is downloaded.
    run(*pip, 'wheel', '-q', '--no-deps', '--no-build-isolation', '-w', wheels, copy)
    options = ['-q', '--no-deps', '--ignore-installed', '--prefix', prefix]
    run(*pip, 'install', *options, *wheels.glob('*.whl'))
    return prefix


@needs_colcon
def test_after_colcon_nodes_command_and_shared_files_are_where_ros_looks(colcon_prefix):
    for name in NODES:
        node = colcon_prefix / 'lib' / 'redres_ros' / name
        said = run_sourced(colcon_prefix, node, *FLAGS)
        assert_ran(said, name, colcon_prefix.parents[1])
    assert run_sourced(colcon_prefix, 'which', 'redres').strip() == f'{colcon_prefix}/bin/redres'
    assert_share_files(colcon_prefix)


def test_after_pip_nodes_run_on_their_environments_python(pip_prefix):
    for name in NODES:
        node = pip_prefix / 'lib' / 'redres_ros' / name
        # An environment that is not activated: its bin/ is not on the PATH.
        said = run(node, *FLAGS, PATH='/usr/bin:/bin', PYTHONPATH=site_packages(pip_prefix))
        assert_ran(said, name, pip_prefix)
    # All packages of an environment share bin/.
    commands = {path.name for path in (pip_prefix / 'bin').iterdir()}
    assert commands == {'redres', *(f'redres_{name}' for name in NODES)}


def test_pip_installs_every_file_that_is_no_module(pip_prefix):
    assert_share_files(pip_prefix)
    package = site_packages(pip_prefix) / 'redres_ros'
    assert (package / 'py.typed').is_file()
    wanted = {path.name for path in (ROOT / 'redres_ros' / 'robots').glob('*.urdf')}
    assert {path.name for path in (package / 'robots').glob('*.urdf')} == wanted != set()


def test_every_console_script_names_a_function_that_exists(pip_prefix):
    [wheel] = distributions(path=[str(site_packages(pip_prefix))])
    scripts = wheel.entry_points.select(group='console_scripts')
    assert len(scripts) > 1
    assert all(callable(script.load()) for script in scripts)


def assert_ran(said: str, name: str, folder: Path) -> None:
    """The probe of that name ran on this Python, from inside the folder, with FLAGS unchanged."""
    who, python, module, *arguments = said.splitlines()
    assert (who, python, arguments) == (name, sys.executable, FLAGS)
    assert Path(module).is_relative_to(folder)


def assert_share_files(prefix: Path) -> None:
    share = prefix / 'share'
    assert (share / 'ament_index' / 'resource_index' / 'packages' / 'redres_ros').is_file()
    folders = [*(ROOT / 'config').rglob('*'), *(ROOT / 'launch').rglob('*.py')]
    files = [ROOT / 'package.xml', *filter(Path.is_file, folders)]
    assert len(files) > 2
    for file in files:
        installed = share / 'redres_ros' / file.relative_to(ROOT)
        assert installed.read_bytes() == file.read_bytes()


def site_packages(prefix: Path) -> Path:
    [folder] = prefix.glob('lib/python3*/site-packages')
    return folder


def run_sourced(colcon_prefix: Path, *command: object) -> str:
    """What the command prints in a shell that has sourced the package."""
    source = '. "$0/share/redres_ros/package.bash" && exec "$@"'
    return run('bash', '-c', source, colcon_prefix, *command)


def run(*command: object, **variables: object) -> str:
    """What the command prints, with these environment variables changed."""
    done = subprocess.run(
        list(map(str, command)),
        env=os.environ | {name: str(value) for name, value in variables.items()},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, f'{command}: {done.returncode}\n{done.stdout}{done.stderr}'
    return done.stdout
