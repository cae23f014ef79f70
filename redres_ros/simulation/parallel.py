"""The same work on many things, on all processors, with one progress for the whole."""

import gc
import multiprocessing
import os
import signal
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from typing import Any, TypeVar

from redres_ros.errors import RedresError

Thing = TypeVar('Thing')
Result = TypeVar('Result')
Progress = Callable[[float], None]

_LOOK = 0.1  # [s] between looks at how far the others are

# in a worker: what to do, with what, and an array, shared by all, of how far each piece is
_work: Any = None
_things: Sequence[Any] = ()
_shares: Any = None


def in_parallel(
    work: Callable[[Thing, Progress], Result], things: Sequence[Thing], progress: Progress
) -> list[Result]:
    """The results of work(thing, progress), in the order of the things.

    Args:
        work: Runs in a process of its own, a copy of this one, and its result is sent back.
        things: Of any kind: the copy has them already.
        progress: Is told the share of the whole that is done, 0 to 1.

    Raises:
        RedresError: As one of the pieces of work raised it.
    """
    workers = min(len(os.sched_getaffinity(0)), len(things))
    if workers <= 1:
        return [work(thing, _part(progress, place, things)) for place, thing in enumerate(things)]
    shares = multiprocessing.RawArray('d', len(things))
    # A copy of this process has everything loaded already.
    context = multiprocessing.get_context('fork')
    others = set(multiprocessing.active_children())
    with ProcessPoolExecutor(workers, context, _begin, (work, things, shares)) as pool:
        try:
            futures = [pool.submit(_piece, place) for place in range(len(things))]
            _watch(futures, shares, progress)
        except BaseException:  # whatever it is, nobody waits for the other results any more
            for process in set(multiprocessing.active_children()) - others:
                process.kill()
            raise
        return [future.result() for future in futures]


def _part(progress: Progress, place: int, things: Sequence[Any]) -> Progress:
    """Turns the progress of one thing into that of the whole; those before it are done."""
    return lambda share: progress((place + share) / len(things))


def _watch(futures: Sequence[Future[Any]], shares: Sequence[float], progress: Progress) -> None:
    """Tell the progress until everything is done. Raises what a piece of work raised."""
    pending = set(futures)
    while pending:
        done, pending = wait(pending, _LOOK, FIRST_COMPLETED)
        for future in done:
            future.result()
        progress(sum(shares) / len(shares))


def _begin(work: Any, things: Sequence[Any], shares: Any) -> None:
    global _work, _things, _shares
    gc.freeze()  # garbage of the process that was copied is its own to clear away, as nodes of ROS
    _work = work
    _things = things
    _shares = shares
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C reaches all processes: end without words


def _piece(place: int) -> Any:
    def progress(share: float) -> None:
        _shares[place] = share

    try:
        result = _work(_things[place], progress)
    except RedresError as error:  # what has more arguments than a text cannot be sent
        raise RedresError(str(error)) from None
    progress(1.0)
    return result
