"""The paper's ideal loop: tick by tick one written from the equations alone; expected figures."""

from dataclasses import replace
from functools import cache

import independent
import numpy as np
import pytest
from doubles import LateArm

from redres_ros import LAWS, Controller, RedresError, RobotModel, load_task, make_law
from redres_ros.planning.planner import TargetFollower
from redres_ros.preview import Preview
from redres_ros.simulation.closed_loop import run
from redres_ros.simulation.recording import Recording

pytestmark = pytest.mark.slow

MODEL = RobotModel.named('lwr4_paper', dynamics='cylinders')
TASK = load_task('rectangle')
T = 0.002  # [s], unless a figure was expected at 1 ms
K_D = 10.0  # [1/s]
FORGETFUL = -1.0  # stands for the damping 1/T


@cache
def simulated(law: str, T: float, k_d: float = K_D) -> Recording:
    """The whole task under a law; every test asks for the same few runs."""
    damping = 1.0 / T if k_d == FORGETFUL else k_d
    return run(Controller(MODEL, make_law(law, damping=damping), T), TASK)


DAMPED = [*((law, K_D) for law in independent.LAWS), ('dynamically_consistent', FORGETFUL)]


@cache
def damped_loops() -> np.ndarray:
    """q (ticks, rows of DAMPED, 7) of the whole task."""
    laws, k_d = zip(*DAMPED, strict=True)
    dampings = np.where(np.array(k_d) == FORGETFUL, 1.0 / T, k_d)
    return independent.loop(list(laws), dampings, T, np.tile(independent.Q0, (len(laws), 1)), 9.0)


@pytest.mark.parametrize(('law', 'k_d'), DAMPED)
def test_the_whole_motion_is_that_of_an_independent_loop(law, k_d):
    q = simulated(law, T, k_d).vectors('q1')
    expected = damped_loops()[:, DAMPED.index((law, k_d))]
    ticks = min(len(q), len(expected))  # minimum_torque arrives some ticks late
    assert ticks == round(9.0 / T)
    # A start 1e-12 rad away ends 1e-10 rad away with minimum_torque and 1e-11 with the others;
    # rounding is far below.
    assert np.abs(q[:ticks] - expected).max() < 1e-8


FIGURES = pytest.mark.parametrize(
    ('law', 'k_d', 'acceleration', 'at', 'velocity', 'torque'),
    [
        ('minimum_velocity', K_D, (64.0, 0.05), 7.76, 4.01, 21.4),
        ('minimum_acceleration', K_D, (8.67, 0.005), 7.35, 2.04, 21.3),
        ('minimum_acceleration', 0.0, (244.0, 0.5), 5.97, 8.57, 76.15),
        ('dynamically_consistent', FORGETFUL, (88.5, 0.05), 0.0, 4.00, 22.9),
    ],
)


@FIGURES
def test_the_peaks_are_those_expected(law, k_d, acceleration, at, velocity, torque):
    recording = simulated(law, 0.001, k_d)
    value, t = recording.peak('joint_acceleration_norm')
    digits = acceleration[1]  # that are known, as of the others
    assert value == pytest.approx(acceleration[0], abs=digits)
    assert t == pytest.approx(at, abs=0.0051)
    assert recording.peak('joint_velocity_norm')[0] == pytest.approx(velocity, abs=0.0051)
    assert recording.peak('joint_torque_norm')[0] == pytest.approx(torque, abs=0.051)
    assert recording.finished
    assert recording['t'][-1] == pytest.approx(8.999, abs=1e-9)
    assert 'reached the last point after 9.000 s' in recording.ending


# With least torque, at 80 rad/s, J is not constant for a tick.
@pytest.mark.parametrize('law', sorted({*LAWS} - {'minimum_torque'}))
def test_the_tip_stays_nearer_to_the_line_than_a_point_must_be_reached(law):
    assert simulated(law, T)['task_error'].max() < TASK.tolerance


def test_progress_goes_from_nothing_to_all():
    shares: list[float] = []
    brief = replace(TASK, waypoints=TASK.waypoints[:2])
    run(Controller(MODEL, make_law('minimum_velocity'), T), brief, progress=shares.append)
    assert shares[0] == 0.0
    assert 0.9 < shares[-1] <= 1.0
    assert shares == sorted(shares)


def test_a_point_out_of_reach_ends_the_loop_in_time_and_says_so():
    task = replace(
        TASK,
        waypoints=np.array((TASK.waypoints[0], (-0.4, 0.36, 0.02), (0.0, 0.0, 1.5))),
        segment_time=0.1,
    )
    recording = run(Controller(MODEL, make_law('minimum_velocity'), T), task)
    assert not recording.finished
    assert recording.ending == 'did not reach the last point within 0.6 s'


BOX = ('position', 'velocity', 'acceleration')


@pytest.mark.parametrize(
    ('law', 'scale', 't_end', 'least'),
    [
        ('minimum_velocity', 1.0, 9.080, 0.318),
        ('minimum_velocity', 0.5, 9.008, 0.850),
        ('minimum_acceleration', 1.0, 8.998, 1.0),
        ('minimum_acceleration', 0.5, 9.786, 0.127),
    ],
)
def test_within_limits_the_path_is_kept_and_only_time_is_stretched(law, scale, t_end, least):
    controller = Controller(MODEL, make_law(law), T, limits=BOX, limit_scale=scale)
    recording = run(controller, TASK)
    assert recording.finished
    assert recording['t'][-1] == pytest.approx(t_end, abs=0.0021)  # one tick
    assert recording['task_scaling'].min() == pytest.approx(least, abs=0.003)
    assert recording['task_error'].max() < 0.5e-3
    dq = recording.vectors('dq1')
    ddq = np.diff(dq, axis=0, prepend=np.zeros((1, 7))) / T
    assert (np.abs(dq) <= scale * MODEL.dq_max * (1.0 + 1e-12)).all()
    assert (np.abs(ddq) <= scale * np.array(MODEL.arm.acceleration_limit) * (1.0 + 1e-9)).all()


def test_an_arm_that_is_behind_its_reference_keeps_the_path_too():
    """It is behind on the path, but not off it: 0.8 mm with a Jacobian from where the arm is."""
    controller = Controller(MODEL, make_law('minimum_velocity'), T, limits=BOX)
    recording = run(controller, TASK, plant=LateArm(TASK.start))
    deviation = TASK.path_deviation(recording.vectors('x'), recording['segment'])
    assert deviation.max() < 0.5e-3


def test_where_tasks_conflict_least_torque_diverges_and_says_so_and_limits_carry_it_through():
    options = {'secondary_tasks': ('orientation',)}
    alone = run(Controller(MODEL, make_law('minimum_torque'), 0.008, **options), TASK)
    # At which tick depends on the last bits: errors grow a thousandfold within some of them.
    assert alone.ending.startswith('diverged at ')
    assert not alone.finished
    assert np.isfinite(alone.data).all()
    assert alone['segment'][-1] == 2  # the side on which the conflict begins
    limited = Controller(MODEL, make_law('minimum_torque'), 0.008, limits=BOX, **options)
    recording = run(limited, TASK)
    assert recording.finished
    assert recording['task_error'].max() < 5e-3  # at this period


def test_a_start_of_other_joints_is_refused():
    with pytest.raises(RedresError, match='start of the task'):
        run(Controller(MODEL, 'minimum_velocity', 0.01), replace(TASK, start=np.zeros(0)))


def test_a_follower_of_arrays_leads_the_tip_through_each_pose_at_its_time():
    task = load_task('fr3_square')
    model = RobotModel.named('fr3')
    x, _ = model.tip(task.start)
    times = np.linspace(0.0, 2.0, 41)  # [s]
    angle = np.pi * times
    points = x + 0.02 * np.column_stack((np.cos(angle) - 1.0, np.sin(angle), 0.0 * angle))
    follower = TargetFollower(task, x, None, np.zeros(3), 0.0, speed=1.0)
    follower.set_path(Preview(times, points))
    recording = run(Controller(model, 'minimum_acceleration', 0.005), task, source=follower)
    assert recording.finished, recording.ending
    assert np.abs(recording.vectors('x')[::10] - points[:-1]).max() < task.tolerance
