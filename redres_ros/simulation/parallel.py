"""The same work on many items, on all processors, with one progress for the whole."""

import gc
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from typing import Any, TypeVar

from redres_ros.errors import RedresError
from redres_ros.files.processes import end_with_parent
from redres_ros.files.signals import handle

Item = TypeVar('Item')
Result = TypeVar('Result')
Progress = Callable[[float], None]

_LOOK = 0.1  # [s] between looks at how far the others are

# in a worker: what to do, with what, and an array, shared by all, of how far each piece is
_work: Any = None
_items: Sequence[Any] = ()
_fractions: Any = None


def in_parallel(
    work: Callable[[Item, Progress], Result], items: Sequence[Item], progress: Progress
) -> list[Result]:
    """The results of work(item, progress), in the order of the items.

    Args:
        work: Runs in a process of its own, a copy of this one, and its result is sent back.
        items: Items of any kind: the copy has them already.
        progress: Called with the fraction of the whole that is done, 0 to 1.

    Raises:
        RedresError: As one of the pieces of work raised it.
    """
    workers = min(len(os.sched_getaffinity(0)), len(items))
    if workers <= 1:
        return [work(item, _part(progress, place, items)) for place, item in enumerate(items)]
    fractions = multiprocessing.RawArray('d', len(items))
    with processes(workers, _share, work, items, fractions) as pool:
        futures = [pool.submit(_piece, place) for place in range(len(items))]
        _watch(futures, fractions, progress)
        return [future.result() for future in futures]


@contextmanager
def processes(
    workers: int, begin: Callable[..., None] | None = None, *args: Any
) -> Iterator[Executor]:
    """Worker processes, which are killed if the block ends by an exception, Ctrl-C included.

    Args:
        workers: How many.
        begin: Called first in each.
        *args: Its arguments.
    """
    # A copy of this process has everything loaded already.
    context = multiprocessing.get_context('fork')
    others = set(multiprocessing.active_children())
    gc.freeze()  # copies must not destroy objects of this process, such as ROS nodes
    with ProcessPoolExecutor(workers, context, _begin, (begin, args)) as pool:
        try:
            yield pool
        except BaseException:  # nobody waits for the other results any more
            for process in set(multiprocessing.active_children()) - others:
                process.kill()
            raise
        finally:
            gc.unfreeze()


def _part(progress: Progress, place: int, items: Sequence[Any]) -> Progress:
    """Turns the progress of one item into that of the whole; those before it are done."""
    return lambda fraction: progress((place + fraction) / len(items))


def _watch(futures: Sequence[Future[Any]], fractions: Sequence[float], progress: Progress) -> None:
    """Report the progress until everything is done. Raises what a piece of work raised."""
    pending = set(futures)
    while pending:
        done, pending = wait(pending, _LOOK, FIRST_COMPLETED)
        for future in done:
            future.result()
        progress(sum(fractions) / len(fractions))


def _begin(begin: Callable[..., None] | None, args: Sequence[Any]) -> None:
    # Ctrl-C and Slurm's SIGTERM reach all processes: end silently.
    handle(signal.SIG_DFL, signal.SIGINT, signal.SIGTERM)
    end_with_parent(signal.SIGKILL)  # else it would wait for ever
    if begin:
        begin(*args)


def _share(work: Any, items: Sequence[Any], fractions: Any) -> None:
    global _work, _items, _fractions
    _work = work
    _items = items
    _fractions = fractions


def _piece(place: int) -> Any:
    def progress(fraction: float) -> None:
        _fractions[place] = fraction

    try:
        result = _work(_items[place], progress)
    except RedresError as error:  # what has more arguments than a text cannot be sent
        raise RedresError(str(error)) from None
    progress(1.0)
    return result
