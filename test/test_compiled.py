"""Compiling: with a folder for the cache and without, and never in the loop."""

import ctypes
import os
import shutil
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numba import float64
from numba.core import caching

from redres_ros.files.signals import handled, interruptible
from redres_ros.kernels import cache, compile_log
from redres_ros.kernels.cache import ROOM, own_folder, stamp
from redres_ros.kernels.closed_form import closed_form
from redres_ros.kernels.compiled import compiled, direct, vector


def halved(x: float) -> float:
    return x / 2.0


def test_where_no_folder_for_the_cache_can_be_written_it_is_compiled_all_the_same(monkeypatch):
    monkeypatch.setattr(caching.CompileResultCacheImpl, '_locator_classes', [])
    with pytest.raises(RuntimeError, match='cannot cache'):  # what numba itself says to that
        caching.FunctionCache(halved)
    assert compiled(float64(float64))(halved)(3.0) == 1.5


def first(x: np.ndarray) -> float:
    return x[0]


def test_names_that_older_versions_of_numba_call_private_are_found():
    assert cache._place('CacheLocator') is caching._CacheLocator


def test_a_function_called_directly_gives_the_same():
    function = compiled(float64(vector()))(first)
    for x in (np.arange(3.0), np.arange(6.0)[::-2]):
        assert direct(function)(x) == function(x) == x[0]


def test_without_compiling_the_formulas_run_as_python():
    source = 'from redres_ros.kernels.rotation_error import rotation_error as f; print(f.__name__)'
    done = subprocess.run(
        [sys.executable, '-c', source],
        env=os.environ | {'NUMBA_DISABLE_JIT': '1'},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == 'rotation_error'


@pytest.mark.slow
def test_what_is_kept_is_loaded_without_the_compiler_and_scipy():
    """Which take longer to load than all the rest."""
    source = 'import sys, redres_ros.nodes.controller; print(*sys.modules)'
    done = subprocess.run(
        [sys.executable, '-c', source], capture_output=True, text=True, check=True
    )
    loaded = set(done.stdout.split())
    assert 'redres_ros.kernels.closed_form' in loaded
    assert not {'scipy.linalg', 'numba.np.linalg'} & loaded


def test_another_type_of_argument_compiles_nothing():
    """What has not been compiled when the module is loaded is refused, not compiled in a tick."""
    with pytest.raises(TypeError, match='No matching definition'):
        closed_form(*(np.zeros((3, 7), np.float32),) * 8)


def test_ctrl_c_that_gets_lost_while_compiling_comes_at_the_end():
    swallowing = suppress(KeyboardInterrupt)  # as ctypes does with what a callback raises
    with pytest.raises(KeyboardInterrupt), interruptible(), swallowing:
        signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_ctrl_c_in_a_callback_from_c_is_not_printed(monkeypatch):
    printed = []
    monkeypatch.setattr(sys, 'unraisablehook', printed.append)
    callback = ctypes.CFUNCTYPE(None)(lambda: signal.raise_signal(signal.SIGINT))
    with pytest.raises(KeyboardInterrupt), interruptible():
        callback()
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
from redres_ros.kernels.arithmetic import dot
from redres_ros.kernels.compiled import compiled, vector

@compiled(float64(vector()))
def square(x):
    return dot(x, x)
"""
ASK = """
import numpy as np
from redres_ros.kernels.square import square

print(square(np.full(3, 2.0)), sum(square.stats.cache_misses.values()))
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A package with one kernel alone."""
    folder = tmp_path / 'redres_ros' / 'kernels'
    folder.mkdir(parents=True)
    (tmp_path / 'redres_ros' / '__init__.py').touch()
    for name in ('__init__', 'cache', 'compiled', 'compile_log', 'arithmetic'):
        shutil.copy(ROOM / f'{name}.py', folder)
    shutil.copy(ROOM.parent / 'files/signals.py', folder.parent)
    (folder / 'square.py').write_text(KERNEL)
    return folder


def ask(folder: Path, **environment: str) -> tuple[str, str]:
    """What a new process says of the kernel there: its answer and how often it had to compile; and
    what else it prints.
    """
    package = folder.parent.parent
    done = subprocess.run(
        [sys.executable, '-c', ASK],
        cwd=package,
        env=os.environ | {'PYTHONPATH': str(package)} | environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip(), done.stderr.strip()


@pytest.mark.slow
def test_a_change_of_what_a_kernel_calls_compiles_it_anew_and_nothing_else_does(folder):
    """Even where that stands in another file, of which numba by itself would not know."""
    once = (
        'compiling the formulas, which takes a quarter of a minute: once, and kept in '
        f'{folder / "__pycache__"}'
    )
    assert ask(folder) == ('12.0 1', once)
    assert ask(folder) == ('12.0 0', '')
    arithmetic = folder / 'arithmetic.py'
    arithmetic.write_text(arithmetic.read_text().replace('total = 0.0', 'total = 1.0'))
    assert ask(folder) == ('13.0 1', once)
    kept = [path.name.partition('.py3')[0] for path in (folder / '__pycache__').glob('square*.nb?')]
    assert kept == 2 * ['square.square-kernel']  # overwritten, and so after a move of its lines


@pytest.mark.slow
def test_where_neither_installation_nor_home_can_be_written_it_is_kept_among_temporary_files(
    folder, tmp_path
):
    (folder / '__pycache__').touch()  # so that no folder can be there, even for root
    nowhere = str(folder / '__pycache__' / 'none')
    temporary = tmp_path / 'temporary'
    temporary.mkdir()
    places = {'HOME': nowhere, 'XDG_CACHE_HOME': nowhere, 'TMPDIR': str(temporary)}
    answer, reported = ask(folder, **places)
    assert answer == '12.0 1'
    assert f'kept in {temporary}/redres_ros-{os.getuid()}/' in reported
    assert ask(folder, **places) == ('12.0 0', '')
    (temporary / f'redres_ros-{os.getuid()}').chmod(0o777)  # others might have put something in
    answer, reported = ask(folder, **places)
    assert answer == '12.0 1'
    assert reported.endswith('in every process, as no folder to keep them in can be written')


def test_a_node_reports_in_one_line_that_compiling_is_over(monkeypatch, capsys):
    runtime = pytest.importorskip('redres_ros.nodes.runtime', reason='needs ROS 2')
    lines = []
    log = SimpleNamespace(info=lines.append)
    nodes = [SimpleNamespace(get_logger=lambda: log)] * 2
    monkeypatch.setattr(compile_log, '_times', [])
    runtime._log_compiled(nodes)
    assert not lines  # nothing has been compiled
    for _ in range(2):
        compile_log.log_compiling('here')
    assert len(capsys.readouterr().err.splitlines()) == 1
    runtime._log_compiled(nodes)
    assert lines == ['compiled the formulas in 0 s']


def test_a_folder_among_temporary_files_is_for_its_user_alone(tmp_path):
    folder = own_folder(tmp_path)
    assert folder.stat().st_mode & 0o777 == 0o700
    assert own_folder(tmp_path) == folder


@pytest.mark.parametrize('mode', [0o770, 0o705])
def test_a_folder_that_others_may_enter_is_refused(tmp_path, mode):
    own_folder(tmp_path).chmod(mode)
    with pytest.raises(PermissionError):
        own_folder(tmp_path)


def test_a_folder_of_somebody_else_is_refused(tmp_path, monkeypatch):
    folder = own_folder(tmp_path)
    somebody = os.getuid() + 1
    folder.rename(tmp_path / f'redres_ros-{somebody}')
    monkeypatch.setattr(os, 'getuid', lambda: somebody)
    with pytest.raises(PermissionError):
        own_folder(tmp_path)


def test_a_link_in_the_place_of_the_folder_is_refused(tmp_path):
    elsewhere = tmp_path / 'elsewhere'
    elsewhere.mkdir(mode=0o700)
    own_folder(tmp_path).rmdir()
    (tmp_path / f'redres_ros-{os.getuid()}').symlink_to(elsewhere)
    with pytest.raises(PermissionError):
        own_folder(tmp_path)


def test_a_folder_that_others_could_replace_is_refused(tmp_path):
    tmp_path.chmod(0o777)
    with pytest.raises(PermissionError):
        own_folder(tmp_path)
    tmp_path.chmod(0o1777)  # as /tmp is
    assert own_folder(tmp_path).is_dir()


def test_the_stamp_of_a_folder_changes_with_each_of_its_files(tmp_path):
    (tmp_path / 'a.py').write_text('x = 1\n')
    (tmp_path / 'b.py').write_text('')
    found = {stamp(tmp_path)}
    for name in ('a.py', 'b.py', 'c.py'):
        (tmp_path / name).write_text('x = 2\n')
        stamp.cache_clear()
        found.add(stamp(tmp_path))
    stamp.cache_clear()
    assert len(found) == 4
