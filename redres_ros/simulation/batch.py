"""Many motions on many processors: on this computer, or wherever an executor runs them."""

import os
import platform
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from dataclasses import dataclass, replace
from functools import cache
from threading import get_ident
from typing import Any

import numpy as np

from redres_ros.controller import Controller
from redres_ros.errors import RedresError
from redres_ros.files.installed import version_of
from redres_ros.files.plugins import load_plugins
from redres_ros.planning.waypoints import WaypointTask, load_task
from redres_ros.robot_model import RobotModel
from redres_ros.robots import Arm, choose_arm
from redres_ros.simulation.case import Case
from redres_ros.simulation.closed_loop import run
from redres_ros.simulation.effort import Effort
from redres_ros.simulation.parallel import processes
from redres_ros.simulation.random_tasks import RANDOM_TASKS, make_random_task
from redres_ros.simulation.recording import Recording

_CLOSED = 1e-9  # [m] between the ends of a path that closes
_MOST_WAITING = 10_000  # cases submitted to an executor at once


@dataclass(frozen=True)
class Result:
    """The figures of one motion.

    Attributes:
        case: The motion.
        effort: What it demanded of the arm; None if it could not be computed.
        duration: Until the last point was reached [s].
        time_lost: Part of it by which limits stretched the task [s].
        path_deviation: Largest distance of the tip from its path [m].
        closure: Distance of the joints' end from their start, where the path closes [rad]; NaN
            elsewhere.
        min_singular_value: The smallest one of the task Jacobian on the way.
        min_task_scaling: The smallest fraction of the task velocity that limits allowed.
        error: Why there is no effort; empty if there is one.
        versions: Versions of what computed it.
    """

    case: Case
    effort: Effort | None = None
    duration: float = np.nan
    time_lost: float = np.nan
    path_deviation: float = np.nan
    closure: float = np.nan
    min_singular_value: float = np.nan
    min_task_scaling: float = np.nan
    error: str = ''
    versions: str = ''

    @property
    def finished(self) -> bool:
        """Whether the last point was reached."""
        return self.effort is not None and self.effort.finished

    @property
    def within_limits(self) -> bool:
        """Whether no joint went beyond a limit of its own."""
        return self.effort is not None and not self.effort.violation


@dataclass(frozen=True)
class _Job:
    """A case with all that a worker needs for it.

    Args:
        case: The motion.
        arm: Arm with the URDF's text.
        task: Read from its file; None: a random one.
        failures: Workers that died with it.
    """

    case: Case
    arm: Arm
    task: WaypointTask | None
    failures: int = 0


def batch(
    cases: Iterable[Case | Mapping[str, Any]], executor: Executor | None = None
) -> Iterator[Result]:
    """The results of many motions, as they finish.

    A case whose worker dies is tried once more. A case that fails has its reason in its result, and
    the others go on. Stop early by closing the iterator, or with Ctrl-C: nothing that was returned
    is lost.

    Args:
        cases: Cases, or mappings of their fields.
        executor: Where they run: any executor of concurrent.futures, such as Dask's
            `client.get_executor()` or MPI's pool; None: one process for each processor.

    Raises:
        RedresError: A case that no worker could run, before any of them runs; an executor that
            takes no more work.
    """
    jobs = deque(_jobs(Case.of(case) for case in cases))
    if executor is not None:
        yield from _results(jobs, executor, _MOST_WAITING)
        if jobs:
            raise RedresError(f'{type(executor).__name__} is broken; {len(jobs)} cases are left')
    while jobs:  # again, with new processes, if one of them has died
        workers = min(len(os.sched_getaffinity(0)), len(jobs))
        with processes(workers) as pool:
            yield from _results(jobs, pool, 2 * workers)


@cache
def versions() -> str:
    """Versions of this package and of what its figures depend on."""
    packages = [
        f'{name} {version_of(name) or "not installed"}' for name in ('redres_ros', 'pin', 'numpy')
    ]
    return f'{", ".join(packages)}, Python {platform.python_version()}'


def _jobs(cases: Iterable[Case]) -> Iterator[_Job]:
    """Jobs of cases; raises RedresError for one that cannot be run."""
    checked = set()
    for case in cases:
        load_plugins(case.plugins)
        arm = _arm(case)
        task = _task(case.task)
        kind = repr(replace(case, seed=0))
        if kind not in checked:
            model = _model(arm)
            _controller(case, model, task)
            checked.add(kind)
        yield _Job(case, arm, task)


def _results(jobs: deque[_Job], executor: Executor, most: int) -> Iterator[Result]:
    """Results of the jobs, which are taken away, until the executor is broken or none is left."""
    running: dict[Future[Result], _Job] = {}
    while jobs or running:
        try:
            # A job whose worker has died runs alone: if the next one dies, too, it is to blame.
            while jobs and len(running) < (1 if jobs[0].failures else most):
                running[executor.submit(_work, jobs[0])] = jobs[0]
                jobs.popleft()
        except BrokenExecutor:
            if not running:
                return
        for future in wait(running, return_when=FIRST_COMPLETED).done:
            job = running.pop(future)
            error = future.exception()
            if error is None:
                yield future.result()
            elif job.failures:
                reason = f'its worker failed twice: {error or type(error).__name__}'
                yield Result(job.case, error=reason, versions=versions())
            else:
                jobs.appendleft(replace(job, failures=1))


def _work(job: _Job) -> Result:
    """The result of a job; runs in a worker."""
    return run_case(job.case, job.arm, job.task)


def run_case(case: Case, arm: Arm, task: WaypointTask | None) -> Result:
    """The result of a case.

    Args:
        case: The motion.
        arm: The case's.
        task: The case's; None: a random one.
    """
    load_plugins(case.plugins)
    try:
        model = _model(arm)
        task = task or make_random_task(case.task, model, case.robot, case.seed)
        recording = run(_controller(case, model, task), task, greedy=False)
        return _result(case, recording, model, task)
    except RedresError as error:
        return Result(case, error=str(error), versions=versions())


def _arm(case: Case) -> Arm:
    return _find_arm(case.robot, case.tip_frame, case.elbow_frame, case.dynamics)


@cache
def _find_arm(robot: str, tip: str, elbow: str, dynamics: str) -> Arm:
    """The arm with the text of its URDF."""
    return replace(choose_arm(robot, tip, elbow), dynamics=dynamics).with_text()


def _model(arm: Arm) -> RobotModel:
    """The model of an arm in this thread: two threads must not compute with the same one."""
    return _model_in_thread(arm, get_ident())


@cache
def _model_in_thread(arm: Arm, thread: int) -> RobotModel:
    return RobotModel(arm)


@cache
def _task(name: str) -> WaypointTask | None:
    """The task of that name or file; None for a random one."""
    return None if name in RANDOM_TASKS else load_task(name)


def _controller(case: Case, model: RobotModel, task: WaypointTask | None) -> Controller:
    """The controller of a case.

    Args:
        case: The motion.
        model: Model of its arm.
        task: Its task; None: a random one, which is of positions.
    """
    if task is not None:
        task.check_joints(model.n)
    has_orientations = task is not None and task.orientations is not None
    return Controller(
        model,
        case.law,
        case.T,
        task='pose' if has_orientations else 'position',
        limits=case.limits,
        limit_scale=case.limit_scale,
        torque_scale=case.torque_scale,
        scaling=case.scaling,
        limit_gains=case.gains,
        preferences=case.preferences,
        secondary_tasks=case.secondary_tasks,
    )


def _result(case: Case, recording: Recording, model: RobotModel, task: WaypointTask) -> Result:
    duration = len(recording.data) * recording.T
    ends = task.waypoints[-1] - task.waypoints[0]
    is_closed = recording.finished and np.linalg.norm(ends) < _CLOSED
    q = recording.vectors('q1')
    deviation = task.path_deviation(recording.vectors('x'), recording['segment'])
    return Result(
        case,
        Effort.of(recording, model),
        duration=duration,
        time_lost=float(np.sum(1.0 - recording['task_scaling'])) * recording.T,
        path_deviation=float(deviation.max()),
        closure=float(np.linalg.norm(q[-1] - q[0])) if is_closed else np.nan,
        min_singular_value=float(recording['min_singular_value'].min()),
        min_task_scaling=float(recording['task_scaling'].min()),
        versions=versions(),
    )
