"""Batches: the same figures wherever they run, and nothing is lost when a worker dies."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from redres_ros import Case, Controller, Effort, RedresError, RobotModel, batch, run
from redres_ros.cli import main
from redres_ros.errors import FileError, UnknownNameError
from redres_ros.files.signals import handled
from redres_ros.robots import ARMS
from redres_ros.simulation import batch as module
from redres_ros.simulation import results_file
from redres_ros.simulation.batch import Result
from redres_ros.simulation.case import grid
from redres_ros.simulation.random_tasks import (
    RANDOM_TASKS,
    contrasting_task,
    make_random_task,
)
from redres_ros.simulation.results_file import COLUMNS, ResultsFile
from redres_ros.simulation.summary import summaries

T = 0.02  # [s]
CASES = [
    Case(law=law, seed=seed, T=T)
    for law in ('minimum_velocity', 'minimum_acceleration')
    for seed in range(2)
]


class InlineExecutor(Executor):
    """Runs at once what is submitted; `before` first."""

    def __init__(self, before: Callable[[], None] = lambda: None) -> None:
        self._before = before

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        """The future of a call that is done."""
        self._before()
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except RedresError as error:
            future.set_exception(error)
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
@pytest.mark.parametrize('executor', [None, InlineExecutor(), ThreadPoolExecutor(2)])
def test_figures_are_those_of_a_single_run_wherever_they_are_computed(executor, alone):
    results = by_case(batch(CASES, executor))
    assert results.keys() == alone.keys()
    for case, result in results.items():
        assert result.effort.acceleration == pytest.approx(alone[case].acceleration, rel=1e-9)
        assert result.effort.kinetic_energy == pytest.approx(alone[case].kinetic_energy, rel=1e-9)


@pytest.fixture
def dying(monkeypatch, tmp_path) -> Callable[[int], None]:
    """Makes the worker of the case with seed 1 die this many times."""
    real = module.run_case

    def install(times: int) -> None:
        def run_case(case: Case, arm: Any, task: Any) -> Any:
            deaths = len(list(tmp_path.glob('death_*')))
            if case.seed == 1 and deaths < times:
                (tmp_path / f'death_{deaths}').touch()
                os._exit(1)
            return real(case, arm, task)

        monkeypatch.setattr(module, 'run_case', run_case)

    return install


def test_a_worker_that_dies_costs_its_case_a_retry(dying):
    dying(1)
    results = list(batch([Case(seed=seed, T=T) for seed in range(4)]))
    assert sorted(result.case.seed for result in results) == [0, 1, 2, 3]
    assert all(result.finished for result in results)


def test_a_case_that_kills_every_worker_is_reported_and_the_others_go_on(dying):
    dying(100)
    results = {result.case.seed: result for result in batch([Case(seed=k, T=T) for k in range(4)])}
    assert 'failed twice' in results[1].error
    assert all(results[seed].finished for seed in (0, 2, 3))


_PARENT = """
import os, signal
from redres_ros.simulation.parallel import processes

with processes(1) as pool:
    print(pool.submit(os.getpid).result(), flush=True)
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_workers_end_with_a_parent_that_is_killed():
    parent = subprocess.run([sys.executable, '-c', _PARENT], capture_output=True, text=True)
    worker = Path(f'/proc/{int(parent.stdout)}/stat')
    end = time.monotonic() + 60.0
    while worker.exists() and worker.read_text().split()[2] != 'Z' and time.monotonic() < end:
        time.sleep(0.05)
    assert not worker.exists() or worker.read_text().split()[2] == 'Z'


def test_an_executor_that_is_broken_is_an_error_in_one_line():
    def fail() -> None:
        raise BrokenExecutor

    with pytest.raises(RedresError, match='InlineExecutor is broken; 1 cases are left'):
        list(batch([Case(T=T)], InlineExecutor(fail)))


def test_an_arm_from_a_urdf_travels_as_text(tmp_path):
    urdf = tmp_path / 'arm.urdf'
    urdf.write_text(RobotModel.named('fr3').arm.description())
    case = Case(str(urdf), T=T, tip_frame=RobotModel.named('fr3').arm.tip_frame)
    (result,) = batch([case], InlineExecutor(lambda: urdf.unlink(missing_ok=True)))
    assert result.finished, result.error


@pytest.mark.parametrize(
    ('fields', 'words'),
    [
        ({'law': 'fastest'}, 'fastest'),
        ({'speed': 1}, 'field of a case'),
        ({'T': 'fast'}, 'T of a case'),
        ({'limits': ['gravity']}, 'gravity'),
        ({'task': 'nowhere'}, 'nowhere'),
        ({'seed': -1}, 'seed of a case'),
        ({'gains': {'dampnig': 1.0}}, 'dampnig'),
    ],
)
def test_a_wrong_case_is_refused_before_any_other_runs(fields, words, monkeypatch):
    monkeypatch.setattr(module, 'run_case', lambda *_: pytest.fail('a case was run'))
    with pytest.raises(RedresError, match=words):
        next(batch([{'T': T}, fields], InlineExecutor()))


def test_lists_are_combined_and_a_list_of_names_is_one_value():
    cases = grid(
        {'law': ['minimum_velocity', 'minimum_acceleration'], 'seeds': 3, 'limits': ['velocity']}
    )
    assert len(cases) == 6
    assert {case.limits for case in cases} == {('velocity',)}
    assert [case.seed for case in cases] == [0, 0, 1, 1, 2, 2]  # one seed after the other
    assert len(grid({'limits': [[], ['velocity']]})) == 2
    with pytest.raises(UnknownNameError, match='laws'):
        grid({'laws': ['minimum_velocity']})


@pytest.mark.slow
@pytest.mark.parametrize('kind', RANDOM_TASKS)
def test_a_random_task_is_the_same_every_time_and_starts_at_its_first_point(kind):
    model = RobotModel.named('fr3')
    task = make_random_task(kind, model, 'fr3', 3)
    assert (task.waypoints == make_random_task(kind, model, 'fr3', 3).waypoints).all()
    assert model.tip(task.start)[0] == pytest.approx(task.waypoints[0])


@pytest.mark.nightly
@pytest.mark.slow
def test_on_a_path_searched_for_only_the_pseudoinverse_leaves_the_limits():
    model = RobotModel.from_urdf(ARMS['fr3'].urdf, 'tool0')
    task = contrasting_task(model, 'my_arm.urdf')
    least_velocity, least_acceleration = (
        Effort.of(run(Controller(model, law, 0.004), task), model)
        for law in ('minimum_velocity', 'minimum_acceleration')
    )
    assert least_velocity.acceleration > 1.5 * least_acceleration.acceleration  # 4.1 times
    assert least_velocity.violation
    assert not least_acceleration.violation


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


@pytest.mark.parametrize('ending', ['csv', 'parquet'])
def test_a_file_knows_what_it_holds(ending, tmp_path):
    if ending == 'parquet':
        pytest.importorskip('pyarrow')
    path = tmp_path / f'results.{ending}'
    case = Case(T=T, limits=('position', 'velocity'), gains={'damping': 5.0})
    (result,) = batch([case], InlineExecutor())
    with ResultsFile(path) as file:
        assert case not in file
        file.add(result)
    with ResultsFile(path) as file:
        assert case in file
        assert Case(T=T) not in file
        (read,) = file.results()
    assert repr(read) == repr(result)  # NaN equals nothing


def test_a_csv_file_whose_last_line_was_cut_off_lacks_that_case_alone(tmp_path):
    path = tmp_path / 'results.csv'
    results = list(batch(CASES[:2], InlineExecutor()))
    with ResultsFile(path) as file:
        for result in results:
            file.add(result)
    text = path.read_text()
    path.write_text(text[: -len(text.splitlines()[-1]) // 2])
    with ResultsFile(path) as file:
        assert results[0].case in file
        assert results[1].case not in file
        file.add(results[1])
    with ResultsFile(path) as file:
        assert results[1].case in file


@pytest.mark.parametrize('text', ['my,own\n1,2\n3,4', 'a single line', '\n'])
def test_a_file_that_holds_something_else_is_refused_and_stays_as_it_is(text, tmp_path):
    path = tmp_path / 'mine.csv'
    path.write_text(text)
    with pytest.raises(FileError, match='name another file'):
        ResultsFile(path)
    assert path.read_text() == text


def test_a_missing_library_for_parquet_is_reported_before_anything_is_computed(
    tmp_path, monkeypatch
):
    monkeypatch.setitem(sys.modules, 'pyarrow', None)
    with pytest.raises(FileError, match='pip install pyarrow'):
        ResultsFile(tmp_path / 'results.parquet')


@pytest.mark.parametrize(
    ('values', 'words'),
    [
        ({'preferences': [[], ['posture']]}, 'preferences: posture'),
        ({'gains': [{'damping': 5.0}, {'posture.gain': 9.0}]}, 'gains: posture.gain = 9.0'),
        ({'dynamics': ['identified', 'cylinders']}, 'dynamics: cylinders'),
        ({'limit_scale': [1.0, 0.5]}, 'limit scale: 0.5'),
    ],
)
def test_motions_under_other_conditions_are_not_taken_for_those_of_another_law(values, words):
    groups = summaries(Result(case) for case in grid({'seeds': 3, **values}))
    assert [len(summary.results) for laws in groups.values() for summary in laws.values()] == [3, 3]
    plain, other = groups
    assert other == f'{plain}, {words}'


def test_the_command_goes_on_where_it_was_ended(tmp_path, capsys):
    study = tmp_path / 'study.yaml'
    study.write_text(f'law: [minimum_velocity, minimum_acceleration]\nT: {T}\nseeds: 2\n')
    assert main(['batch', str(study)]) == 0
    shown = capsys.readouterr().out
    assert '4 of 4 motions added' in shown
    assert 'ratios to minimum_velocity' in shown
    out = tmp_path / 'study.csv'
    heading, *rows = out.read_text().splitlines()
    assert heading == ','.join(COLUMNS)
    out.write_text('\n'.join([heading, *rows[:3]]) + '\n')
    assert main(['batch', str(study)]) == 0
    shown = capsys.readouterr().out
    assert '1 of 1 motions added' in shown
    assert '2 tasks; ratios to minimum_velocity' in shown  # those of the first run, too


def test_a_batch_that_is_terminated_keeps_its_results(tmp_path, monkeypatch):
    pytest.importorskip('pyarrow')  # a CSV file has each result at once

    def terminated(cases: list[Case]) -> Iterator[Result]:
        for result in batch(cases, InlineExecutor()):
            yield result
            os.kill(os.getpid(), signal.SIGTERM)

    monkeypatch.setattr(results_file, 'batch', terminated)
    study = tmp_path / 'study.yaml'
    study.write_text(f'T: {T}\nseeds: 2\n')
    out = tmp_path / 'study.parquet'
    with handled(signal.SIG_IGN, signal.SIGTERM):  # else it would end the tests, if unhandled
        assert main(['batch', str(study), '--out', str(out)]) == 1
    with ResultsFile(out) as file:
        assert len(file.results()) == 1


def test_many_tasks_are_compared_by_ratios(capsys):
    options = '--tasks 2 --period 0.02 --law minimum_velocity,minimum_acceleration@2'
    assert main(['compare', *options.split()]) == 0
    shown = capsys.readouterr().out
    assert 'minimum_acceleration, k_d = 2 1/s' in shown
    assert '2 tasks; ratios to minimum_velocity' in shown


@pytest.mark.nightly
def test_a_dask_cluster_gives_the_same_figures(alone):
    distributed = pytest.importorskip('distributed')
    arguments = {'n_workers': 2, 'threads_per_worker': 1, 'dashboard_address': None}
    with distributed.LocalCluster(**arguments) as cluster, distributed.Client(cluster) as client:
        results = by_case(batch(CASES, client.get_executor()))
    for case, effort in alone.items():
        assert results[case].effort.acceleration == pytest.approx(effort.acceleration, rel=1e-9)
