"""Compiling numerical functions: once, when their module is loaded, and never in the loop."""

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numba
from numba import types
from numba.core.typeinfer import register_dispatcher

from redres_ros.files.signals import interruptible
from redres_ros.kernels.cache import Kept, enter
from redres_ros.kernels.compile_log import log_compiling

# Somebody looks for a fault by NUMBA_DISABLE_JIT: nothing is compiled.
_IN_PYTHON = bool(vars(numba.config)['DISABLE_JIT'])

enter()


def compiled(*signatures: Any) -> Callable[[Callable[..., Any]], Any]:
    """A decorator that compiles a function for the given signatures, or takes it from the cache.

    A function without a signature is a part of others. It is compiled with those that call it, and
    kept within them. Where no folder for the cache can be written, all is compiled anew in every
    process.
    """

    def decorate(function: Callable[..., Any]) -> Any:
        if _IN_PYTHON:
            return function
        if not signatures:
            return _part(function, 'never')
        with interruptible():  # LLVM calls back into Python, where an interrupt would get lost
            return _made(function, signatures)

    return decorate


def inlined(function: Callable[..., Any]) -> Any:
    """A part of others that is written into them, as if it stood there.

    This is for what is called at one place, which then compiles in less time, and for the smallest
    parts: calls of those take up to a fifth of a kernel's time. Large ones that are called at many
    places compile in two or three times the time.
    """
    return _part(function, 'always')


def _part(function: Callable[..., Any], inline: str) -> Any:
    """A function that only others of its kind call. Without wrappers, which Python would need."""
    options: Any = {'inline': inline, 'no_cpython_wrapper': True, 'no_cfunc_wrapper': True}
    return numba.njit(error_model='numpy', **options)(function)


def _made(function: Callable[..., Any], signatures: tuple[Any, ...]) -> Any:
    """As numba.njit(signatures, cache=True) makes it, but from a cache of ours."""
    made: Any = numba.njit(error_model='numpy')(function)
    folder = ''
    with suppress(RuntimeError):  # there is no folder that can be written
        made._cache = Kept(function)  # type: ignore[no-untyped-call]
        folder = made._cache.cache_path
    with register_dispatcher(made):  # a function may call itself
        for signature in signatures:
            made.compile(signature)
    made.disable_compile()
    if not made.stats.cache_hits:
        log_compiling(folder)
    return made


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
