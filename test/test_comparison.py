"""`redres compare`: peaks and integrals of laws side by side."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from redres_ros.cli import main
from redres_ros.controller import Controller
from redres_ros.laws import make_law
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.closed_loop import run
from redres_ros.simulation.comparison import Effort, table
from redres_ros.waypoints import load_task

TASK = replace(load_task('rectangle'), waypoints=load_task('rectangle').waypoints[:2])


def effort(law: str, T: float = 0.002) -> Effort:
    """Of a law on the first segment of the paper's task."""
    model = RobotModel.named('lwr4_paper')
    return Effort.of(run(Controller(model, make_law(law), T), TASK), model)


def test_the_integral_of_kinetic_energy_is_that_of_half_dq_M_dq() -> None:
    model = RobotModel.named('lwr4_paper')
    recording = run(Controller(model, make_law('minimum_velocity'), 0.002), TASK)
    energies = [
        0.5 * dq @ model.state(q, dq).M @ dq
        for q, dq in zip(recording.vectors('q1'), recording.vectors('dq1'), strict=True)
    ]
    assert Effort.of(recording, model).kinetic_energy == pytest.approx(
        0.002 * sum(energies), rel=1e-12
    )


def test_integrals_do_not_depend_on_the_sampling_time() -> None:
    # Left Riemann sums of smooth functions that are nearly zero at both ends; the laws differ by
    # O(T).
    one = effort('minimum_acceleration', 0.002)
    two = effort('minimum_acceleration', 0.001)
    for name in ('squared_torque', 'kinetic_energy', 'elbow'):
        assert getattr(one, name) == pytest.approx(getattr(two, name), rel=0.01)


def test_the_law_of_least_kinetic_energy_spends_the_least_of_it() -> None:
    laws = ('minimum_kinetic_energy', 'minimum_velocity', 'minimum_acceleration')
    efforts = {law: effort(law).kinetic_energy for law in laws}
    assert min(efforts, key=efforts.__getitem__) == 'minimum_kinetic_energy'


def test_the_elbow_of_a_standing_arm_has_no_path() -> None:
    model = RobotModel.named('lwr4_paper')
    still = replace(
        TASK, waypoints=np.repeat(model.tip(TASK.start)[0][None], 2, axis=0), segment_time=0.1
    )
    assert (
        Effort.of(run(Controller(model, make_law('minimum_velocity'), 0.002), still), model).elbow
        == 0.0
    )


def test_the_table_marks_the_least_of_each_column() -> None:
    low = Effort(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 'end')
    high = Effort(2.0, 1.0, 4.0, 5.0, 6.0, 7.0, 8.0, 'end')
    first, second = table({'low': low, 'high': high}).splitlines()[2:4]
    assert (first.count('*'), second.count('*')) == (6, 1)


def test_the_command_writes_plot_and_data(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    laws = 'minimum_velocity,minimum_acceleration@5'
    assert main(['compare', '--laws', laws, '--period', '0.005', '--out', str(tmp_path)]) == 0
    shown = capsys.readouterr().out
    assert 'minimum_acceleration, k_d = 5 1/s' in shown
    assert (tmp_path / 'comparison.png').stat().st_size > 10_000
    assert {path.name for path in tmp_path.glob('*.csv')} == {
        'minimum_velocity_10.csv',
        'minimum_acceleration_5.csv',
    }


@pytest.mark.parametrize(
    ('laws', 'words'),
    [
        ('foo', ('foo', 'minimum_velocity')),
        ('minimum_velocity@x', ('NAME@DAMPING',)),
        ('minimum_velocity@-1', ('-1',)),
        ('', ("''",)),
    ],
)
def test_bad_laws_get_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], laws: str, words: tuple[str, ...]
) -> None:
    assert main(['compare', '--laws', laws, '--out', str(tmp_path)]) == 1
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert all(word in lines[0] for word in words)
