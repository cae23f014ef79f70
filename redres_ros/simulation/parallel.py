"""The same work on many items, on all processors of this computer."""

import gc
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from typing import Any, TypeVar

from redres_ros.errors import RedresError
from redres_ros.files.processes import end_with_parent, handle

Item = TypeVar('Item')
Result = TypeVar('Result')

_shared: tuple[Callable[[Any], Any], Sequence[Any]] | None = None  # in a worker: work, items


def in_parallel(
    work: Callable[[Item], Result], items: Sequence[Item], progress: Callable[[float], None]
) -> list[Result]:
    """The results of work(item), in the order of the items. Raises RedresError as `work` does.

    It runs in copies of this process, so any function and any items will do; results are sent back.
    `progress` is called with the fraction that is done.
    """
    with processes(len(items), (work, items)) as pool:
        futures = [pool.submit(_work_on, place) for place in range(len(items))]
        for done, future in enumerate(as_completed(futures), 1):
            future.result()
            progress(done / len(items))
        return [future.result() for future in futures]


@contextmanager
def processes(most: int, shared: Any = None) -> Iterator[Executor]:
    """At most so many worker processes, one for each processor, which are killed if the block ends
    by an exception, Ctrl-C included. What is shared goes to them with the copy of this process.
    """
    workers = max(min(len(os.sched_getaffinity(0)), most), 1)
    context = multiprocessing.get_context('fork')  # a copy has everything loaded already
    others = set(multiprocessing.active_children())
    gc.freeze()  # copies must not destroy objects of this process, such as ROS nodes
    with ProcessPoolExecutor(workers, context, _begin, (shared,)) as pool:
        try:
            yield pool
        except BaseException:  # nobody waits for the other results any more
            for process in set(multiprocessing.active_children()) - others:
                process.kill()
            raise
        finally:
            gc.unfreeze()


def _begin(shared: Any) -> None:
    # Ctrl-C and Slurm's SIGTERM reach all processes: end silently.
    global _shared
    handle(signal.SIG_DFL, signal.SIGINT, signal.SIGTERM)
    end_with_parent(signal.SIGKILL)  # else it would wait for ever
    _shared = shared


def _work_on(place: int) -> Any:
    assert _shared is not None
    work, items = _shared
    try:
        return work(items[place])
    except RedresError as error:  # what has more arguments than a text cannot be sent
        raise RedresError(str(error)) from None
