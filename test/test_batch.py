"""Batches: the same figures wherever they run, and every case has its result or its reason."""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from redres_ros import Case, Controller, Effort, RedresError, RobotModel, batch, run
from redres_ros.simulation import batch as module
from redres_ros.simulation.random_tasks import RANDOM_TASKS, make_random_task

T = 0.02  # [s]
CASES = [
    Case(law=law, seed=seed, T=T)
    for law in ('minimum_velocity', 'minimum_acceleration')
    for seed in range(2)
]


def cancelled(*_: Any) -> Future[Any]:
    """The future of a call that is cancelled."""
    future: Future[Any] = Future()
    future.cancel()
    future.set_running_or_notify_cancel()
    return future


def by_case(results: Iterator[Any]) -> dict[str, Any]:
    return {repr(result.case): result for result in results}


@pytest.fixture
def alone() -> dict[str, Effort]:
    """The efforts of CASES, one motion after the other, as a user's own loop computes them."""
    model = RobotModel.named('lwr4_paper')
    efforts = {}
    for case in CASES:
        task = make_random_task('random', model, case.robot, case.seed)
        efforts[repr(case)] = Effort.of(run(Controller(model, case.law, T), task), model)
    return efforts


@pytest.mark.slow
@pytest.mark.parametrize('executor', [None, ThreadPoolExecutor(2)])
def test_figures_are_those_of_a_single_run_wherever_they_are_computed(executor, alone):
    results = by_case(batch(CASES, executor))
    assert results.keys() == alone.keys()
    for case, result in results.items():
        assert result.effort.acceleration == pytest.approx(alone[case].acceleration, rel=1e-9)
        assert result.effort.kinetic_energy == pytest.approx(alone[case].kinetic_energy, rel=1e-9)


def test_a_worker_that_dies_is_the_reason_of_the_cases_that_are_left(monkeypatch):
    monkeypatch.setattr(module, '_result', lambda *_: os._exit(1))
    results = list(batch(CASES[:2]))
    assert len(results) == 2
    assert all('its worker failed' in result.error for result in results)


_PARENT = """
import os, signal
from redres_ros.simulation.batch import in_parallel

parent = os.getpid()

def work(_):
    print(os.getpid(), flush=True)
    os.kill(parent, signal.SIGKILL)

in_parallel(work, [0], print)
"""


def test_workers_end_with_a_parent_that_is_killed():
    parent = subprocess.run([sys.executable, '-c', _PARENT], capture_output=True, text=True)
    worker = Path(f'/proc/{int(parent.stdout)}/stat')
    end = time.monotonic() + 60.0
    while worker.exists() and worker.read_text().split()[2] != 'Z' and time.monotonic() < end:
        time.sleep(0.05)
    assert not worker.exists() or worker.read_text().split()[2] == 'Z'


def test_an_executor_that_ended_is_an_error_and_one_that_cancels_the_reason_of_each_case():
    with ThreadPoolExecutor(1) as executor:
        pass
    with pytest.raises(RedresError, match='the executor takes no cases: cannot schedule'):
        next(batch(CASES, executor))
    errors = [result.error for result in batch(CASES[:2], SimpleNamespace(submit=cancelled))]
    assert errors == 2 * ['its worker failed: cancelled']


def test_a_case_that_fails_has_its_reason_and_the_others_go_on(monkeypatch):
    def failing(case: Case, *_: Any) -> Any:
        if case.seed == 0:
            raise RedresError('no luck')
        return module.Result(case)

    monkeypatch.setattr(module, '_result', failing)
    errors = {each.case.seed: each.error for each in batch(CASES[:2], ThreadPoolExecutor(1))}
    assert errors == {0: 'no luck', 1: ''}


def test_an_arm_from_a_urdf_travels_as_text(tmp_path):
    urdf = tmp_path / 'arm.urdf'
    urdf.write_text(RobotModel.named('fr3').arm.description())
    case = Case(str(urdf), T=T, tip_frame=RobotModel.named('fr3').arm.tip_frame)
    with ThreadPoolExecutor(1, initializer=urdf.unlink) as executor:
        (result,) = batch([case], executor)
    assert not urdf.exists()
    assert result.finished, result.error


@pytest.mark.parametrize(
    ('fields', 'words'),
    [
        ({'law': 'fastest'}, 'fastest'),
        ({'T': 'fast'}, "T is 'fast'"),
        ({'task': 'near_singlar'}, 'is near_singular meant.*, random, '),
        ({'seed': -1}, 'seed is -1'),
        ({'gains': {'dampnig': 1.0}}, 'dampnig'),
        ({'limits': 5}, 'limits is 5; expected a list'),
    ],
)
def test_a_wrong_case_is_refused_before_any_other_runs(fields, words, monkeypatch):
    monkeypatch.setattr(module, '_work', lambda *_: pytest.fail('a case was run'))
    with pytest.raises(RedresError, match=words):
        next(batch([Case(T=T), Case(**fields)]))


@pytest.mark.slow
@pytest.mark.parametrize('kind', RANDOM_TASKS)
def test_a_random_task_is_the_same_every_time_and_starts_at_its_first_point(kind):
    model = RobotModel.named('fr3')
    for seed in range(3):
        task = make_random_task(kind, model, 'fr3', seed)
        assert (task.waypoints == make_random_task(kind, model, 'fr3', seed).waypoints).all()
        assert model.tip(task.start)[0] == pytest.approx(task.waypoints[0])
        assert ((task.start > model.q_min) & (task.start < model.q_max)).all()


def test_near_singular_tasks_come_nearer_to_singularities_than_others():
    model = RobotModel.named('lwr4')

    def nearest(kind: str) -> float:
        """The median over tasks of the smallest singular value at their starts."""
        states = [
            model.state(make_random_task(kind, model, 'lwr4', seed).start, np.zeros(model.n))
            for seed in range(5)
        ]
        return float(np.median([np.linalg.svd(each.J[:3])[1].min() for each in states]))

    assert nearest('near_singular') < 0.035 * model.reach < nearest('random')


def test_a_long_task_is_a_minute_there_and_back():
    task = make_random_task('long', RobotModel.named('lwr4'), 'lwr4', 0)
    assert task.segments * task.segment_time == 60.0
    assert (task.waypoints == task.waypoints[::-1]).all()


@pytest.mark.nightly
def test_a_dask_cluster_gives_the_same_figures(alone):
    distributed = pytest.importorskip('distributed')
    arguments = {'n_workers': 2, 'threads_per_worker': 1, 'dashboard_address': None}
    with distributed.LocalCluster(**arguments) as cluster, distributed.Client(cluster) as client:
        results = by_case(batch(CASES, client.get_executor()))
    for case, effort in alone.items():
        assert results[case].effort.acceleration == pytest.approx(effort.acceleration, rel=1e-9)
