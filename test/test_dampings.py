"""Which damping is good, over random tasks."""

import numpy as np
import pytest

from redres_ros import RobotModel
from redres_ros.cli import main
from redres_ros.robots.joint_limits import JointLimits
from redres_ros.simulation.case import Case
from redres_ros.simulation.random_tasks import make_random_task
from redres_ros.simulation.summary import GOOD, Trials, damping_table, sweep


@pytest.mark.slow
def test_random_tasks_begin_within_the_ranges_and_are_the_same_every_time() -> None:
    model = RobotModel.named('fr3')
    limits = JointLimits.of(model.arm)
    for seed in range(20):
        task = make_random_task('random', model, 'fr3', seed)
        assert ((task.start > limits.lower) & (task.start < limits.upper)).all()
        assert model.tip(task.start)[0] == pytest.approx(task.waypoints[0])
        assert (task.waypoints == make_random_task('random', model, 'fr3', seed).waypoints).all()


def test_a_damping_is_judged_beside_the_best_of_the_same_task() -> None:
    peaks = np.array([[1.0, 1.1, 4.0], [20.0, 10.0, np.inf], [np.inf, np.inf, np.inf]])
    trials = Trials('law', np.array([0.0, 1.0, 2.0]), peaks, np.ones((3, 3), dtype=bool))
    assert GOOD == 1.25
    assert trials.good == pytest.approx([0.5, 1.0, 0.0])  # of the two tasks that any one ended
    assert trials.quantiles(0.9) == pytest.approx([2.0, 1.1, np.inf])


def test_a_sweep_finds_what_a_single_run_finds() -> None:
    base = Case('lwr4_paper', T=0.02)
    reported: list[float] = []
    (trials,) = sweep(base, ['minimum_acceleration'], 2, reported.append, (0.0, 10.0))
    assert trials.peaks.shape == trials.kept.shape == (2, 2)
    assert reported[-1] == 1.0
    again = sweep(base, ['minimum_acceleration'], 1, reported.append, (10.0,))
    assert again[0].peaks[0, 0] == trials.peaks[0, 1]


@pytest.mark.parametrize(
    ('options', 'words'),
    [
        ('--tasks 0', 'tasks is 0'),
        ('--period 1', 'period is 1'),
        ('--law minimum_velocity', 'no damping'),
        ('--law fastest', 'fastest'),
    ],
)
def test_bad_options_get_one_line(
    options: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(['dampings', *options.split()]) == 1
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert words in lines[0]


@pytest.mark.slow
def test_the_command_shows_a_table(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['dampings', '--tasks', '1', '--period', '0.01']) == 0
    assert 'median of peak / best' in capsys.readouterr().out


@pytest.mark.parametrize(('tasks', 'head'), [(5, 'largest'), (20, 'nine in ten below')])
def test_no_maximum_is_called_a_quantile(tasks: int, head: str) -> None:
    peaks = np.ones((tasks, 2))
    trials = Trials('law', np.array([0.0, 1.0]), peaks, np.ones((tasks, 2), dtype=bool))
    assert not trials.resolves(0.99)
    assert str(damping_table(trials, 'title').columns[3].header) == head
