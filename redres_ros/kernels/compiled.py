"""Compiling numerical functions: once, when their module is loaded, and never in the loop.

numba keeps what it has compiled beside the source file, or where NUMBA_CACHE_DIR says, or in the
user's cache directory. It compiles a function anew when the file of that function has changed, and
looks at no other file. So each file here holds all that its functions call.
"""

import sys
from collections.abc import Callable
from fcntl import LOCK_EX, flock
from functools import cache
from pickle import UnpicklingError
from typing import Any

import numba
from numba import types

from redres_ros.files.processes import interruptible

_IN_PYTHON = bool(vars(numba.config)['DISABLE_JIT'])  # to look for a fault


def compiled(*signatures: Any) -> Callable[[Callable[..., Any]], Any]:
    """A decorator that compiles a function for the given signatures, or takes it from the cache.

    Where no folder for the cache can be used, it is compiled anew in every process.
    """

    def _decorate(function: Callable[..., Any]) -> Any:
        if _IN_PYTHON:
            return function
        # LLVM calls back into Python, where an interrupt would get lost.
        with interruptible(), open(function.__code__.co_filename, encoding='utf-8') as source:
            flock(source, LOCK_EX)  # of nodes that start side by side one compiles, others wait
            options: Any = {'error_model': 'numpy', 'no_cfunc_wrapper': True}  # nobody calls by C
            try:
                made: Any = numba.njit(list(signatures), cache=True, **options)(function)
            except (RuntimeError, EOFError, UnpicklingError):  # no folder, or a damaged file
                made = numba.njit(list(signatures), **options)(function)
        if not made.stats.cache_hits:
            _report_compiling(made.stats.cache_path or '')
        return made

    return _decorate


@cache
def _report_compiling(folder: str) -> None:
    """Print why a start takes so long, without a terminal too: other programs start nodes."""
    how_often = f'once, cached in {folder}'
    if not folder:
        how_often = 'in every process, since no cache can be used; set NUMBA_CACHE_DIR'
    line = f'compiling the formulas, about a quarter of a minute: {how_often}'
    print(line, file=sys.stderr, flush=True)


def part(function: Callable[..., Any]) -> Any:
    """A function that only compiled ones of its file call, with which it is compiled and kept."""
    return _part(function, 'never')


def inlined(function: Callable[..., Any]) -> Any:
    """A part that is written into its callers, as if it stood there.

    This is for what is called at one place, which then compiles in less time, and for the smallest
    parts, whose calls take up to a fifth of a kernel's time. Others compile in less time as parts
    that call no parts: numba compiles each part once for itself and once with every caller.
    """
    return _part(function, 'always')


def _part(function: Callable[..., Any], inline: str) -> Any:
    options: Any = {'inline': inline, 'no_cpython_wrapper': True, 'no_cfunc_wrapper': True}
    return numba.njit(error_model='numpy', **options)(function)


def direct(function: Any) -> Any:
    """A function compiled for one signature, without numba's look at the types of its arguments.

    That look takes 0.1 us and more, as long as these functions take. The caller guarantees float64
    arrays of as many dimensions as the signature says; others would be misread.
    """
    if _IN_PYTHON:
        return function
    (made,) = function.overloads.values()
    return made.entry_point


def vector(dtype: Any = types.float64) -> Any:
    """The type of a one-dimensional array of any stride, read-only or not."""
    return types.Array(dtype, 1, 'A', readonly=True)


def matrix(dtype: Any = types.float64) -> Any:
    """The type of a two-dimensional array of any order, read-only or not."""
    return types.Array(dtype, 2, 'A', readonly=True)


def several(*members: Any) -> Any:
    """The type of a tuple."""
    return types.Tuple(members)  # type: ignore[no-untyped-call]
