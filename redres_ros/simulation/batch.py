"""Many motions at once, on all processors or by any executor. A case is plain data."""

import gc
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, Executor, ProcessPoolExecutor, as_completed
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np

from redres_ros.controller import Controller
from redres_ros.errors import RedresError, UnknownNameError, reason_of
from redres_ros.files.processes import end_with_parent
from redres_ros.parameter import Checked, as_tuple, param
from redres_ros.planning.waypoints import WaypointTask, task_for
from redres_ros.robot_model import RobotModel
from redres_ros.robots import Arm, choose_arm
from redres_ros.simulation.closed_loop import run
from redres_ros.simulation.random_tasks import RANDOM_TASKS, make_random_task
from redres_ros.simulation.recording import Effort, Recording

_CLOSED = 1e-9  # [m] between the ends of a path that closes

_Item = TypeVar('_Item')
_Done = TypeVar('_Done')

_Job = tuple['Case', Arm, WaypointTask | None]

_shared: tuple[Callable[[Any], Any], Sequence[Any]] | None = None  # in a worker: work, items


@dataclass(frozen=True)
class Case(Checked):
    """One motion as plain data: what `Controller` takes, by names and gains, and the task. Raises
    RedresError for a seed that is none. The controller checks other values.
    """

    robot: str = 'lwr4_paper'  # an arm's name, or the path of a URDF, whose text workers get
    law: str = 'minimum_acceleration'
    T: float = 0.002
    limits: tuple[str, ...] = ()
    limit_scale: float = 1.0
    torque_scale: float = 1.0
    scaling: str = 'task'
    preferences: tuple[str, ...] = ()
    secondary_tasks: tuple[str, ...] = ()
    gains: Mapping[str, Any] = field(default_factory=dict)  # such as {'posture.gain': 4.0}
    task: str = 'random'  # in RANDOM_TASKS, the name of a task, or the path of a task file
    seed: int = param(0, 'seed of a random task', 0, 2**32)
    tip_frame: str = ''  # empty: the arm's own
    elbow_frame: str = ''  # empty: the arm's own
    dynamics: str = 'identified'

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ('limits', 'preferences', 'secondary_tasks'):
            object.__setattr__(self, name, as_tuple(name, getattr(self, name)))


@dataclass(frozen=True)
class Result:
    """The figures of one motion."""

    case: Case
    effort: Effort | None = None  # what it demanded of the arm; None if it could not be computed
    duration: float = np.nan  # until the last point was reached [s]
    time_lost: float = np.nan  # part of it by which limits stretched the task [s]
    closure: float = np.nan  # of the joints' end from their start, if the path closes [rad]
    min_singular_value: float = np.nan  # of the task Jacobian
    error: str = ''  # why there is no effort

    @property
    def finished(self) -> bool:
        return self.effort is not None and self.effort.finished

    @property
    def within_limits(self) -> bool:
        """Whether no joint went beyond a limit of its own."""
        return self.effort is not None and not self.effort.violation


def batch(cases: Iterable[Case], executor: Executor | None = None) -> Iterator[Result]:
    """The results of many motions, as they finish.

    A case that fails has its reason in its result, and the others go on. Close the iterator, or
    press Ctrl-C, to stop early.

    Args:
        executor: Any executor of concurrent.futures, such as Dask's `client.get_executor()` or
            MPI's pool; None: one process for each processor.

    Raises RedresError for a case that no worker could run, before any of them runs, and for an
    executor that takes no cases.
    """
    jobs = list(_checked_jobs(cases))
    with nullcontext(executor) if executor else _processes(len(jobs)) as pool:
        try:
            running = {pool.submit(_work, *job): job[0] for job in jobs}
        except RuntimeError as error:  # it was shut down, or its workers died
            raise RedresError(f'the executor takes no cases: {reason_of(error)}') from None
        for future in as_completed(running):
            failure = CancelledError('cancelled') if future.cancelled() else future.exception()
            if failure is None:
                yield future.result()
            else:
                reason = f'its worker failed: {reason_of(failure) or type(failure).__name__}'
                yield Result(running[future], error=reason)


def in_parallel(
    work: Callable[[_Item], _Done], items: Sequence[_Item], progress: Callable[[float], None]
) -> list[_Done]:
    """The results of work(item), in the order of the items. Raises RedresError as `work` does.

    It runs in copies of this process, so any function and any items will do; results are sent back.
    `progress` is called with the fraction that is done.
    """
    with _processes(len(items), (work, items)) as pool:
        futures = [pool.submit(_work_on, place) for place in range(len(items))]
        for done, future in enumerate(as_completed(futures), 1):
            future.result()
            progress(done / len(items))
        return [future.result() for future in futures]


def make_controller(
    case: Case, model: RobotModel, *, pose: bool = False, switch_time: float = 0.0
) -> Controller:
    """The controller of a case; `pose`: the orientation is part of its task."""
    return Controller(
        model,
        case.law,
        case.T,
        task='pose' if pose else 'position',
        switch_time=switch_time,
        limits=case.limits,
        limit_scale=case.limit_scale,
        torque_scale=case.torque_scale,
        scaling=case.scaling,
        limit_gains=case.gains,
        preferences=case.preferences,
        secondary_tasks=case.secondary_tasks,
    )


def _checked_jobs(cases: Iterable[Case]) -> Iterator[_Job]:
    """Cases with what a worker needs for them; raises RedresError for one that cannot be run."""
    checked: dict[str, tuple[Arm, WaypointTask | None]] = {}  # of cases that differ in seeds alone
    for case in cases:
        kind = repr(replace(case, seed=0))
        if kind not in checked:
            checked[kind] = _arm_and_task(case)
        yield case, *checked[kind]


def _arm_and_task(case: Case) -> tuple[Arm, WaypointTask | None]:
    """The arm with the text of its URDF, and a task that is not random. Raises RedresError."""
    arm = choose_arm(case.robot, case.tip_frame, case.elbow_frame)
    arm = replace(arm, dynamics=case.dynamics)
    model = RobotModel(arm)
    task = None
    if case.task not in RANDOM_TASKS:
        try:
            task = task_for(arm, case.robot, case.task)
        except UnknownNameError as error:
            allowed = (*error.allowed, *RANDOM_TASKS)
            raise UnknownNameError(error.kind, error.got, allowed) from None
    make_controller(case, model, pose=task is not None and task.orientations is not None)
    return arm, task


def _work(case: Case, arm: Arm, task: WaypointTask | None) -> Result:
    """The result of a case, for a task of None a random one; runs in a worker."""
    try:
        model = RobotModel(arm)
        task = task or make_random_task(case.task, model, case.robot, case.seed)
        controller = make_controller(case, model, pose=task.orientations is not None)
        return _result(case, run(controller, task, greedy=False), model, task)
    except RedresError as error:
        return Result(case, error=str(error))


def _result(case: Case, recording: Recording, model: RobotModel, task: WaypointTask) -> Result:
    ends = task.waypoints[-1] - task.waypoints[0]
    is_closed = recording.finished and np.linalg.norm(ends) < _CLOSED
    q = recording.vectors('q1')
    return Result(
        case,
        Effort.of(recording, model),
        duration=len(recording.data) * recording.T,
        time_lost=float(np.sum(1.0 - recording['task_scaling'])) * recording.T,
        closure=float(np.linalg.norm(q[-1] - q[0])) if is_closed else np.nan,
        min_singular_value=float(recording['min_singular_value'].min()),
    )


# --- processes ------------------------------------------------------------------------------------


@contextmanager
def _processes(most: int, shared: Any = None) -> Iterator[Executor]:
    """At most so many worker processes, one for each processor; `shared` is copied to them."""
    workers = max(min(len(os.sched_getaffinity(0)), most), 1)
    context = multiprocessing.get_context('fork')  # a copy has everything loaded already
    gc.freeze()  # copies must not destroy objects of this process, such as ROS nodes
    with ProcessPoolExecutor(workers, context, _begin, (shared,)) as pool:
        try:
            yield pool
        finally:
            pool.shutdown(cancel_futures=True)  # if nobody waits for the other results any more
            gc.unfreeze()


def _begin(shared: Any) -> None:
    # Ctrl-C and Slurm's SIGTERM reach all processes: end silently.
    global _shared
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_DFL)
    end_with_parent(signal.SIGKILL)  # else it would wait for ever
    _shared = shared


def _work_on(place: int) -> Any:
    assert _shared is not None
    work, items = _shared
    try:
        return work(items[place])
    except RedresError as error:  # what has more arguments than a text cannot be sent
        raise RedresError(str(error)) from None
