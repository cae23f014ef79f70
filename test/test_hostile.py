"""Programs in a bad environment: each ends with one clear line, a status, and no traceback."""

import importlib.util
import os
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest
from nightly import by_day
from programs import run_python

from redres_ros.cli import main
from redres_ros.nodes.entry import run_node

pytestmark = pytest.mark.slow

PATIENCE = 120.0  # [s] for a process that should end by itself
REDRES = f'{sys.executable} -m redres_ros.cli'
QUICK = 'simulate --period 0.01'

needs_ros = pytest.mark.skipif(
    importlib.util.find_spec('rclpy') is None, reason='needs ROS 2: pip install .[test]'
)


def shell(line: str, folder: Path, **variables: str) -> tuple[int, str]:
    """Exit status and all that is written to standard error by a line of shell, run in a folder."""
    done = subprocess.run(
        ['bash', '-c', line],
        cwd=folder,
        env={**os.environ, 'PYTHONUNBUFFERED': '', **variables},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    return done.returncode, done.stderr


@pytest.mark.parametrize(
    ('command', 'unbuffered'),
    by_day(
        2,
        [
            ('--help', ''),
            ('--version', ''),
            ('laws', '1'),
            (QUICK, ''),
            (f'{QUICK} --out /dev/full', ''),
        ],
    ),
)
def test_a_full_device_is_reported_in_one_line(tmp_path, command, unbuffered):
    target = '' if '--out' in command else '> /dev/full'
    status, said = shell(f'{REDRES} {command} {target}', tmp_path, PYTHONUNBUFFERED=unbuffered)
    assert status == 1
    assert 'No space left on device' in said
    assert said.count('\n') == 1


@pytest.mark.parametrize(
    'redirection', by_day(1, ['2> /dev/full', '2>&-', '2> /dev/full > /dev/full'])
)
def test_an_error_that_nobody_can_read_still_has_its_status(tmp_path, redirection):
    assert shell(f'{REDRES} simulate --law fastest {redirection}', tmp_path) == (1, '')


def test_a_closed_output_is_reported_in_one_line(tmp_path):
    status, said = shell(f'{REDRES} laws >&-', tmp_path)
    assert status == 1
    assert 'standard output is closed; expected an open one, such as /dev/null' in said
    assert said.count('\n') == 1


def test_a_reader_that_leaves_early_is_not_complained_about(tmp_path):
    status, said = shell(f'{REDRES} laws | true', tmp_path)
    assert (status, said) == (0, '')


@pytest.mark.parametrize(
    ('command', 'files'),
    by_day(1, [(QUICK, 6), ('compare --law minimum_velocity,minimum_torque --period 0.01', 16)]),
)
def test_few_file_descriptors_are_enough_or_reported_in_one_line(tmp_path, command, files):
    status, said = shell(f'ulimit -n {files}; exec {REDRES} {command}', tmp_path)
    assert status in (0, 1)
    assert 'Traceback' not in said
    assert said.count('\n') == status
    assert status == 0 or 'Too many open files' in said


@needs_ros
@pytest.mark.nightly
@pytest.mark.parametrize('files', [8, 16])
def test_few_file_descriptors_for_nodes_are_reported_and_end_with_a_line(tmp_path, files):
    status, said = shell(f'ulimit -n {files}; exec {REDRES} demo --lockstep', tmp_path)
    assert status == 1
    assert 'Traceback' not in said
    assert said.splitlines()[-1].startswith('redres demo: ')  # DDS may have had its say before


@pytest.mark.parametrize('ending', ['yaml', 'urdf'])
@pytest.mark.parametrize('make', [os.mkfifo, os.mkdir, partial(os.symlink, '/dev/zero')])
def test_what_is_no_regular_file_is_refused_at_once(tmp_path, capsys, make, ending):
    path = tmp_path / f'a.{ending}'
    make(path)
    option = '--task' if ending == 'yaml' else '--robot'
    assert main(['simulate', option, str(path)]) == 1
    said = capsys.readouterr().err
    assert said.startswith('redres simulate: ')
    assert str(path) in said
    assert said.count('\n') == 1


INTERRUPTED = """
import os, signal, sys

class Interrupt:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            try:
                os.kill(os.getpid(), signal.SIGINT)
            except KeyboardInterrupt as error:  # modules in C make another one of it
                raise {kind}

sys.meta_path.insert(0, Interrupt())
"""

COMMAND = 'from redres_ros.cli import main\nsys.exit(main(["simulate"]))'
NODE = 'from redres_ros.nodes.entry import sim\nsys.exit(sim())'
LOADED = ['argparse', 'redres_ros.cli.options', 'numpy', 'pinocchio', 'rich.progress', 'yaml']
BY_NODES = ['rclpy', 'numpy', 'redres_ros.nodes.sim', 'mujoco']


@pytest.mark.parametrize(
    ('program', 'module'),
    [
        *((COMMAND, module) for module in by_day(2, LOADED)),
        *(pytest.param(NODE, module, marks=needs_ros) for module in by_day(2, BY_NODES)),
    ],
)
def test_ctrl_c_while_a_program_loads_ends_it_quietly(tmp_path, program, module):
    kind = 'ImportError' if program == NODE else 'error'
    done = run_python('-c', INTERRUPTED.format(module=module, kind=kind) + program, cwd=tmp_path)
    assert (done.returncode, done.stdout + done.stderr) == (130, '')


@pytest.mark.parametrize('starts', ['redres_ros.cli', 'redres_ros.nodes.runtime'])
def test_a_process_without_an_error_output_gets_one_before_a_file_takes_its_number(starts):
    script = f"""
import sys
import {starts} as module
getattr(module, 'main', print)(['laws'])
getattr(module, 'run_nodes', lambda **given: 0)(arguments=[])
print(sys.stderr.fileno())
"""
    started = [sys.executable, '-c', script]
    done = subprocess.run(
        ['bash', '-c', 'exec "$@" 2>&-', 'bash', *started],
        env={**os.environ, 'ROS_DOMAIN_ID': 'none'},  # nothing is to run
        capture_output=True,
        text=True,
    )
    assert done.stdout.splitlines()[-1:] == ['2'], done.stdout


@pytest.mark.parametrize('name', ['composed', 'controller', 'planner', 'sim'])
def test_a_node_prints_its_help_and_refuses_an_option_that_it_does_not_have(name, capsys):
    assert run_node(name, ['--help']) == 0
    printed = capsys.readouterr()
    assert printed.err == ''
    assert printed.out.startswith(f'usage: redres_{name} ')
    assert run_node(name, ['--law', 'minimum_velocity']) == 2
    said = "got '--law'; parameters go as --ros-args -p NAME:=VALUE, see --help"
    assert capsys.readouterr().err == f'redres_{name}: {said}\n'
