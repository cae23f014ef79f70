"""Compiling: with a folder for the cache and without, and never in the loop."""

import subprocess
import sys

import numpy as np
import pytest
from numba import float64
from numba.core import caching

from redres_ros.closed_form import closed_form
from redres_ros.compiled import compiled, direct, vector


def halved(x: float) -> float:
    return x / 2.0


def test_where_no_folder_for_the_cache_can_be_written_it_is_compiled_all_the_same(monkeypatch):
    monkeypatch.setattr(caching.CompileResultCacheImpl, '_locator_classes', [])
    with pytest.raises(RuntimeError, match='cannot cache'):  # what numba itself says to that
        caching.FunctionCache(halved)
    assert compiled(float64(float64))(halved)(3.0) == 1.5


def first(x: np.ndarray) -> float:
    return x[0]


def test_a_function_called_directly_gives_the_same():
    function = compiled(float64(vector()))(first)
    for x in (np.arange(3.0), np.arange(6.0)[::-2]):
        assert direct(function)(x) == function(x) == x[0]


def test_another_type_of_argument_compiles_nothing():
    """What has not been compiled when the module is loaded is refused, not compiled in a tick."""
    with pytest.raises(TypeError, match='No matching definition'):
        closed_form(*(np.zeros((3, 7), np.float32),) * 8)


def test_a_second_process_finds_what_the_first_one_compiled():
    import redres_ros.closed_form  # noqa: F401, which fills the cache

    program = (
        'from redres_ros.closed_form import closed_form\n'
        'print(sum(closed_form.stats.cache_misses.values()))\n'
    )
    done = subprocess.run(
        [sys.executable, '-c', program], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == '0'
