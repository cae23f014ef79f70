"""Recordings: what a row holds, in which order, and that a file gives back every bit."""

import numpy as np
import pytest

from redres_ros import Command, RobotModel
from redres_ros.command import VALUES
from redres_ros.planning.planner import Reference
from redres_ros.resolution import Solution
from redres_ros.simulation.recording import MotionRecorder, Recording, columns

T = 0.002  # [s]
COLUMNS = (
    't,q1,q2,q3,q4,q5,q6,q7,dq1,dq2,dq3,dq4,dq5,dq6,dq7,x,y,z,x_d,y_d,z_d,task_error,joint_velocity_norm,'
    'joint_acceleration_norm,null_velocity_norm,joint_torque_norm,min_singular_value,'
    'task_scaling,segment'
)


@pytest.fixture
def tick(model: RobotModel) -> tuple[Command, Reference]:
    """A command and a reference whose numbers are all different."""
    random = np.random.default_rng(0)
    state = model.state(random.normal(size=7), random.normal(size=7))
    dq = random.normal(size=7)
    x_d = random.normal(size=3)
    reference = Reference(random.normal(size=3), x_d, x_d - state.x, 2, False)
    command = Command(Solution(dq, state.J[:3], np.zeros(3), s=0.75), state.q + T * dq, state, T)
    return command, reference


@pytest.fixture
def recording() -> Recording:
    data = np.random.default_rng(1).normal(size=(50, len(columns(7)))) * 10.0 ** np.linspace(
        -14, 14, len(columns(7))
    )
    data[0, :4] = 1.0 / 3.0, np.nextafter(1.0, 2.0), 5e-324, -0.0
    return Recording(data, 7, T, True, 'ended')


def of_one(command: Command, reference: Reference) -> Recording:
    """The recording of a single tick, at 0.5 s."""
    recorder = MotionRecorder(command.state.model, T)
    recorder.add(0.5, command, reference, command.s)
    return recorder.recording('')


def test_a_row_holds_the_vectors_of_its_tick(tick):
    command, reference = tick
    recording = of_one(command, reference)
    assert recording['t'] == [0.5]
    for name, vector in (
        ('q1', command.state.q),
        ('dq1', command.dq),
        ('x', command.state.x),
        ('x_d', reference.x_d),
    ):
        assert recording.vectors(name)[0] == pytest.approx(vector, abs=1e-15)
    assert recording['task_error'] == pytest.approx(np.linalg.norm(reference.error), rel=1e-14)
    assert recording['task_scaling'] == [0.75]
    assert recording['segment'] == [2]


def test_a_figure_is_that_of_the_command_to_rounding(tick):
    recording = of_one(*tick)
    for name, figure in VALUES.items():
        assert recording[name] == pytest.approx(figure(tick[0]), rel=1e-12)


def test_a_vector_is_found_by_its_first_column(recording):
    assert recording.vectors('q1').shape == recording.vectors('dq1').shape == (50, 7)
    for names in ('q1 q2 q3 q4 q5 q6 q7', 'dq1 dq2 dq3 dq4 dq5 dq6 dq7', 'x y z', 'x_d y_d z_d'):
        first, *others = names.split()
        assert (recording.vectors(first).T == [recording[name] for name in (first, *others)]).all()


def test_the_peak_is_the_largest_value_and_its_time(recording):
    value, t = recording.peak('task_error')
    assert value == recording['task_error'].max()
    assert t == recording['t'][recording['task_error'] == value][0]


def test_a_file_read_back_gives_the_same_bits(recording, tmp_path):
    path = tmp_path / 'deep' / 'motion.csv'
    recording.write_csv(path)
    read = np.loadtxt(path, delimiter=',', skiprows=1)
    assert read.tobytes() == recording.data.tobytes()


def test_a_recording_without_rows_has_a_heading_still(model, tmp_path):
    empty = MotionRecorder(model, T).recording('ended before it began')
    empty.write_csv(tmp_path / 'motion.csv')
    assert empty.data.shape == (0, len(columns(7)))
    assert (tmp_path / 'motion.csv').read_text() == COLUMNS + '\n'
