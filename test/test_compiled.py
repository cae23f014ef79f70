"""Compiling: with a folder for the cache and without, and never in the loop."""

import ctypes
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba import float64
from programs import run_python

import redres_ros
from redres_ros.files.processes import handled, interruptible
from redres_ros.kernels.closed_form import fill_factor
from redres_ros.kernels.compiled import compiled, direct, vector

PACKAGE = Path(redres_ros.__file__).parent


def first(x: np.ndarray) -> float:
    return x[0]


def test_a_function_called_directly_gives_the_same():
    function = compiled(float64(vector()))(first)
    for x in (np.arange(3.0), np.arange(6.0)[::-2]):
        assert direct(function)(x) == function(x) == x[0]


def test_another_type_of_argument_compiles_nothing():
    """What has not been compiled when the module is loaded is refused, not compiled in a tick."""
    with pytest.raises(TypeError, match='No matching definition'):
        fill_factor(*(np.zeros((3, 7), np.float32),) * 2)


def test_ctrl_c_in_a_callback_from_c_is_raised_at_the_end_and_not_printed(monkeypatch):
    printed = []
    monkeypatch.setattr(sys, 'unraisablehook', printed.append)
    callback = ctypes.CFUNCTYPE(None)(lambda: signal.raise_signal(signal.SIGINT))
    with pytest.raises(KeyboardInterrupt), interruptible():
        callback()  # ctypes swallows what a callback raises
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert not printed
    ctypes.CFUNCTYPE(None)(lambda: signal.raise_signal(signal.SIGINT))()
    assert len(printed) == 1  # by others


def test_a_handler_of_somebody_else_is_asked_once():
    asked = []
    with handled(lambda number, _: asked.append(number), signal.SIGINT), interruptible():
        signal.raise_signal(signal.SIGINT)
    assert asked == [signal.SIGINT]


KERNEL = """
from numba import float64
from redres_ros.kernels.compiled import compiled, part, vector

@part
def total(x):
    total = 0.0
    for i in range(len(x)):
        total += x[i]
    return total

@compiled(float64(vector()))
def doubled(x):
    return 2.0 * total(x)
"""
ASK = """
import numpy as np
from redres_ros.kernels.doubled import doubled

stats = getattr(doubled, 'stats', None)
print(doubled(np.full(3, 2.0)), sum(stats.cache_misses.values()) if stats else 'in Python')
"""


@pytest.fixture
def kernels(tmp_path: Path) -> Path:
    """A package with one kernel alone."""
    package = tmp_path / 'redres_ros'
    for folder in (package, package / 'files', package / 'kernels'):
        folder.mkdir()
        (folder / '__init__.py').touch()
    for name in ('kernels/compiled.py', 'files/processes.py'):
        shutil.copy(PACKAGE / name, package / name)
    (package / 'kernels' / 'doubled.py').write_text(KERNEL)
    return package / 'kernels'


def ask(kernels: Path, **environment: str) -> tuple[str, str]:
    """The kernel's result in a new process with the number of its compilations; and its stderr."""
    package = kernels.parent.parent
    variables = os.environ | {'PYTHONPATH': str(package)} | environment
    done = run_python('-c', ASK, cwd=package, env=variables, check=True)
    return done.stdout.strip(), done.stderr.strip()


@pytest.mark.slow
def test_a_change_of_what_a_kernel_calls_compiles_it_anew_and_nothing_else_does(kernels):
    assert ask(kernels, NUMBA_DISABLE_JIT='1') == ('12.0 in Python', '')
    result, logged = ask(kernels)
    assert result == '12.0 1'
    assert logged.endswith(f'once, cached in {kernels / "__pycache__"}')
    assert len(logged.splitlines()) == 1
    assert ask(kernels) == ('12.0 0', '')
    doubled = kernels / 'doubled.py'
    doubled.write_text(doubled.read_text().replace('total = 0.0', 'total = 10.0'))
    assert ask(kernels)[0] == '32.0 1'
    [index] = (kernels / '__pycache__').glob('doubled.*.nbi')
    os.truncate(index, 0)
    assert 'in every process' in ask(kernels)[1]


@pytest.mark.nightly
def test_where_no_folder_can_be_written_every_process_compiles_and_says_what_helps(
    kernels, tmp_path
):
    (kernels / '__pycache__').touch()  # so that no folder can be there, even for root
    nowhere = str(kernels / '__pycache__' / 'none')
    places = {'HOME': nowhere, 'XDG_CACHE_HOME': nowhere}
    for _ in range(2):
        result, logged = ask(kernels, **places)
        assert result == '12.0 1'
        assert logged.endswith('in every process, since no cache can be used; set NUMBA_CACHE_DIR')
    places['NUMBA_CACHE_DIR'] = str(tmp_path / 'cache')
    assert ask(kernels, **places)[0] == '12.0 1'
    assert ask(kernels, **places) == ('12.0 0', '')


def test_of_processes_that_start_side_by_side_one_compiles(tmp_path):
    program = tmp_path / 'program.py'
    program.write_text(
        'from numba import float64\n'
        'from redres_ros.kernels.compiled import compiled\n'
        "input('ready')\n"
        '@compiled(float64(float64))\n'
        'def double(x):\n'
        '    return 2.0 * x\n'
        'print(sum(double.stats.cache_misses.values()))\n'
    )
    pipes = {'stdin': subprocess.PIPE, 'stdout': subprocess.PIPE}
    two = [subprocess.Popen([sys.executable, '-u', program], **pipes) for _ in range(2)]
    for process in two:
        assert process.stdout.read(5) == b'ready'
    for process in two:
        process.stdin.write(b'\n')
        process.stdin.flush()
    assert sorted(process.communicate()[0] for process in two) == [b'0\n', b'1\n']
