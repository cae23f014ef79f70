"""`redres compare`: peaks and integrals of laws side by side."""

import gc
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from redres_ros import RobotModel
from redres_ros.cli import main
from redres_ros.controller import Controller
from redres_ros.errors import RangeError, RedresError
from redres_ros.laws import make_law
from redres_ros.planning.planner import Planner
from redres_ros.planning.waypoints import load_task, task_for
from redres_ros.robots import arm_from_urdf, find_arm
from redres_ros.robots.joint_limits import JointLimits
from redres_ros.simulation.batch import in_parallel
from redres_ros.simulation.closed_loop import run
from redres_ros.simulation.optimum import best_motion
from redres_ros.simulation.recording import Effort, Recording, columns
from redres_ros.simulation.report import comparison_tables, label, print_tables

TASK = replace(load_task('rectangle'), waypoints=load_task('rectangle').waypoints[:2])


def test_integrals_are_sums_over_the_ticks():
    model = RobotModel.named('lwr4_paper')
    recording = run(Controller(model, make_law('minimum_velocity'), 0.002), TASK)
    energies = [
        0.5 * dq @ model.state(q, dq).M @ dq
        for q, dq in zip(recording.vectors('q1'), recording.vectors('dq1'), strict=True)
    ]
    effort = Effort.of(recording, model)
    assert effort.kinetic_energy == pytest.approx(0.002 * sum(energies), rel=1e-12)
    squares = recording['joint_torque_norm'] ** 2
    assert effort.squared_torque == pytest.approx(0.002 * sum(squares), rel=1e-12)


def test_the_table_marks_the_least_of_each_column(capsys):
    low = Effort(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, '', True, 'end')
    high = Effort(2.0, 1.0, 4.0, 5.0, 6.0, 7.0, 8.0, '', True, 'end')
    print_tables(*comparison_tables({'low': low, 'high': high}, 'title'))
    rows = capsys.readouterr().out.splitlines()
    marks = {
        law: sum(row.count('*') for row in rows if row.split()[:1] == [law])
        for law in ('low', 'high')
    }
    assert marks == {'low': 6, 'high': 1}


def test_a_violation_and_how_an_unfinished_motion_ended_are_shown(capsys):
    a = Effort(1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 'a2 position, 1.00 s', True, 'reached')
    b = replace(a, finished=False, ending='diverged', violation='')
    print_tables(*comparison_tables({'a': a, 'b': b}, 'title'))
    shown = capsys.readouterr().out
    assert 'no: a2 position, 1.00 s' in shown
    assert 'b: diverged' in shown
    assert 'a: reached' not in shown


@pytest.mark.parametrize(('least', 'share'), [(2.0, '50 %'), (3.95, '-'), (4.5, '-')])
def test_the_share_of_a_possible_gain_is_a_dash_where_that_is_small(least, share, capsys):
    first = Effort(1.0, 1.0, 1.0, 4.0, 1.0, 1.0, 1.0, '', True, 'end')
    efforts = {'first': first, 'other': replace(first, squared_acceleration=3.0)}
    print_tables(*comparison_tables(efforts, 'title', least))
    shown = ' '.join(capsys.readouterr().out.split())
    assert f' {share} * least' in shown
    assert ('could gain less than 2 %' in shown) == (share == '-')


def still(ticks: int, T: float = 0.01) -> np.ndarray:
    """Rows of a recording of an arm of 7 joints that stands at zero."""
    rows = np.zeros((ticks, len(columns(7))))
    rows[:, 0] = T * np.arange(ticks)
    return rows


LWR = RobotModel.named('lwr4')
LIMITS = JointLimits.of(LWR.arm)


def violation(rows: np.ndarray) -> str:
    return Effort.of(Recording(rows, 7, 0.01, True, ''), LWR).violation


@pytest.mark.parametrize(
    ('column', 'first', 'most', 'quantity'),
    [
        ('q1', 4, LIMITS.upper[0], 'position'),
        ('q7', 4, LIMITS.upper[6], 'position'),
        ('dq3', 20, LIMITS.velocity[2], 'velocity'),
        ('dq2', 0, 0.01 * LIMITS.acceleration[1], 'acceleration'),  # a jump from rest
    ],
)
def test_the_first_violation_is_named_by_its_joint_and_time(column, first, most, quantity):
    rows = still(1000)
    values = rows[:, columns(7).index(column)]
    ramp = np.linspace(0.0, 1.0, first, endpoint=False)  # within the acceleration limits
    values[:first] = most * ramp if quantity == 'velocity' else 0.0
    values[first:] = most
    assert violation(rows) == ''
    values[first:] = most * (1.0 + 1e-6)
    rows[-1, columns(7).index('q4')] = 10.0  # later
    joint = LIMITS.joint_names[int(column[-1]) - 1]
    assert violation(rows) == f'{joint} {quantity}, {0.01 * first:.2f} s'


def test_the_best_motion_keeps_path_and_ranges_and_is_better_than_any_law():
    task = load_task('rectangle')
    model = RobotModel.named('lwr4_paper')
    law = make_law('minimum_acceleration', horizon=2.0)
    recording = run(Controller(model, law, 0.01), task)
    effort, q, T = best_motion(model, task, [recording])
    assert (q[0] == task.start).all()
    path = Planner(task).preview(0.0, T * (len(q) - 1), step=T).positions
    errors = [np.linalg.norm(model.tip(each)[0] - x) for each, x in zip(q, path, strict=False)]
    assert max(errors[1:]) < 1e-4
    assert ((model.q_min <= q) & (q <= model.q_max)).all()
    dq = np.diff(q, axis=0, prepend=q[:1]) / T
    assert effort == pytest.approx(float((np.diff(dq, axis=0) ** 2).sum() / T))
    assert effort < 0.95 * Effort.of(recording, model).squared_acceleration
    assert best_motion(model, replace(task, switching='within_tolerance'), [recording]) is None
    assert best_motion(model, task, []) is None


def test_the_label_of_a_law_names_every_gain_that_is_not_its_default():
    law = make_law('minimum_torque', gravity=0.5)
    assert label(law) == 'minimum_torque, gravity 0.5, k_d = 10 1/s'


@pytest.mark.slow
def test_the_command_writes_plot_and_data(tmp_path, capsys):
    laws = 'minimum_velocity,minimum_acceleration@5,minimum_acceleration@horizon=1'
    assert main(['compare', '--law', laws, '--period', '0.005', '--out', str(tmp_path)]) == 0
    shown = capsys.readouterr().out
    assert 'minimum_acceleration, k_d = 5 1/s' in shown
    assert 'the best motion along the path' in shown
    assert (tmp_path / 'comparison.png').stat().st_size > 10_000
    assert {path.name for path in tmp_path.glob('*.csv')} == {
        'minimum_velocity.csv',
        'minimum_acceleration_5.csv',
        'minimum_acceleration_1_s_ahead_10.csv',
    }


def test_an_arm_from_a_urdf_has_an_effort_and_an_elbow():
    model = RobotModel(arm_from_urdf(find_arm('iiwa7').urdf, 'tool0'))
    task = task_for(model.arm, 'arm.urdf')
    effort = Effort.of(run(Controller(model, 'minimum_acceleration', 0.02), task), model)
    assert effort.elbow > 0.0
    assert np.isfinite(list(vars(effort).values())[:7]).all()


def square(number: int) -> int:
    if number < 0:
        raise RangeError('number', number, 0.0, 10.0)
    return number**2


def test_results_come_in_the_order_of_the_work():
    reported: list[float] = []
    assert in_parallel(square, [3, 1, 2], reported.append) == [9, 1, 4]
    assert reported == pytest.approx([1 / 3, 2 / 3, 1.0])


def test_what_a_piece_of_work_refuses_is_refused():
    with pytest.raises(RedresError, match='number is -1; allowed: 0 to 10'):
        in_parallel(square, [1, -1, 2], lambda share: None)


class Leftover:
    """Garbage that only a search finds, and that says which process has cleared it away."""

    def __init__(self, marker: Path):
        self.marker = marker
        self.itself = self

    def __del__(self):
        self.marker.write_text(str(os.getpid()), encoding='utf-8')


def test_a_copy_does_not_clear_away_the_garbage_of_the_process_that_was_copied(tmp_path):
    def collected(item):
        gc.collect()
        return item

    marker = tmp_path / 'cleared'
    Leftover(marker)
    assert in_parallel(collected, [1, 2], lambda share: None) == [1, 2]
    assert not marker.exists() or marker.read_text(encoding='utf-8') == str(os.getpid())
