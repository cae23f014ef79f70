"""Compiling: with a folder for the cache and without, and never in the loop."""

import ctypes
import os
import shutil
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from numba import float64
from numba.core import caching

from redres_ros.kernels import cache
from redres_ros.kernels.cache import ROOM, stamp
from redres_ros.kernels.closed_form import closed_form
from redres_ros.kernels.compiled import compiled, direct, vector
from redres_ros.signals import handled, interruptible


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
    source = 'from redres_ros.kernels.turn import turn_between as f; print(f.__name__)'
    done = subprocess.run(
        [sys.executable, '-c', source],
        env=os.environ | {'NUMBA_DISABLE_JIT': '1'},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == 'turn_between'


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


def ask(package: Path) -> str:
    """What a new process says of the kernel there: its answer, and how often it had to compile."""
    done = subprocess.run(
        [sys.executable, '-c', ASK],
        cwd=package,
        env=os.environ | {'PYTHONPATH': str(package)},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip()


@pytest.mark.slow
def test_a_change_of_what_a_kernel_calls_compiles_it_anew_and_nothing_else_does(tmp_path):
    """Even where that stands in another file, of which numba by itself would not know."""
    room = tmp_path / 'redres_ros' / 'kernels'
    room.mkdir(parents=True)
    (tmp_path / 'redres_ros' / '__init__.py').touch()
    for name in ('__init__', 'cache', 'compiled', 'arithmetic'):
        shutil.copy(ROOM / f'{name}.py', room)
    shutil.copy(ROOM.parent / 'signals.py', room.parent)
    (room / 'square.py').write_text(KERNEL)
    assert ask(tmp_path) == '12.0 1'
    assert ask(tmp_path) == '12.0 0'
    arithmetic = room / 'arithmetic.py'
    arithmetic.write_text(arithmetic.read_text().replace('total = 0.0', 'total = 1.0'))
    assert ask(tmp_path) == '13.0 1'
    kept = [path.name.partition('.py3')[0] for path in (room / '__pycache__').glob('square*.nb?')]
    assert kept == 2 * ['square.square-kernel']  # overwritten, and so after a move of its lines


def test_the_stamp_of_a_room_changes_with_each_of_its_files(tmp_path):
    (tmp_path / 'a.py').write_text('x = 1\n')
    (tmp_path / 'b.py').write_text('')
    found = {stamp(tmp_path)}
    for name in ('a.py', 'b.py', 'c.py'):
        (tmp_path / name).write_text('x = 2\n')
        stamp.cache_clear()
        found.add(stamp(tmp_path))
    stamp.cache_clear()
    assert len(found) == 4
