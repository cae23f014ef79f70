"""Planner: quintic segments (36), feedback (37), and when one segment follows the other."""

from dataclasses import replace
from typing import Any
from unittest import mock

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from redres_ros import Planner, Preview, WaypointTask
from redres_ros.errors import ArrayError
from redres_ros.geometry import quintic
from redres_ros.kernels.tick import rotation_error
from redres_ros.planning import planner as planner_module
from redres_ros.planning.planner import Reference, TargetFollower, source_of

T = 0.001  # [s]
EYE = np.eye(3)


def turned(*rotation_vectors: tuple[float, float, float]) -> np.ndarray:
    return Rotation.from_rotvec(rotation_vectors).as_matrix()


@pytest.fixture
def square() -> WaypointTask:
    """Three segments of 0.5 s."""
    points = np.array(((0.4, 0.0, 0.5), (0.5, 0.0, 0.5), (0.5, 0.1, 0.5), (0.4, 0.1, 0.6)))
    return WaypointTask('lwr4', np.zeros(7), points, segment_time=0.5)


@pytest.fixture
def turning(square: WaypointTask) -> WaypointTask:
    """The same, with the tip turned another way at each of its four points."""
    turns = turned((0.0, 0.0, 0.0), (0.5, 0.0, 0.0), (0.5, 0.4, 0.0), (0.0, 0.0, -0.3))
    return replace(square, orientations=turns)


def follow(
    planner: Planner, x: np.ndarray, ticks: int, R: np.ndarray | None = None
) -> list[Reference]:
    """References for an ideal tip, which also turns unless R is None."""
    references = []
    for k in range(ticks):
        reference = planner.reference(x, k * T, R)
        references.append(reference)
        x = x + T * reference.dx[:3]
        R = R if R is None else turned(T * reference.dx[3:])[0] @ R
    return references


def column(references: list[Reference], name: str) -> np.ndarray:
    return np.array([getattr(reference, name) for reference in references])


def test_the_quintic_is_that_of_the_paper_and_stands_still_at_its_ends_and_beyond():
    for xi in np.linspace(0.0, 1.0, 21):
        s = 6 * xi**5 - 15 * xi**4 + 10 * xi**3
        ds = 30 * xi**4 - 60 * xi**3 + 30 * xi**2
        assert quintic(xi) == pytest.approx((s, ds), abs=1e-14)
    assert [quintic(xi) for xi in (-1.0, 0.0)] == [(0.0, 0.0)] * 2
    assert [quintic(xi) for xi in (1.0, 2.0)] == [(1.0, 0.0)] * 2


def test_a_segment_is_a_straight_line_from_rest_to_rest_between_its_points(square):
    references = follow(Planner(square), square.waypoints[0], 500)
    A = square.waypoints[0]
    line = square.waypoints[1] - A
    fraction = (column(references, 'x_d') - A) @ line / (line @ line)
    assert column(references, 'x_d') == pytest.approx(A + fraction[:, None] * line, abs=1e-15)
    assert (np.diff(fraction) > 0.0).all()
    assert not references[0].dx.any()
    still = follow(Planner(replace(square, feedback_gain=0.0)), A, 500)
    assert np.linalg.norm(still[-1].dx) < 1e-4  # 30 * 0.002^2 * 0.1 m / 0.5 s


def test_the_desired_velocity_is_the_derivative_of_the_desired_position(square):
    references = follow(Planner(square), square.waypoints[0], 500)
    feed_forward = column(references, 'dx') - square.feedback_gain * column(references, 'error')
    differences = np.diff(column(references, 'x_d'), axis=0) / T  # at half ticks
    # T^2 / 24 times the third derivative of the quintic, at most 60 / 0.125 s^3 * 0.1 m: 2e-6
    assert (feed_forward[1:] + feed_forward[:-1]) / 2 == pytest.approx(differences, abs=1e-5)


def test_feedback_is_the_gain_times_the_error_and_limited_in_speed(square):
    error = np.array((0.3, -0.4, 0.0))
    x = square.waypoints[0] - error
    assert Planner(square, feedback_limit=0.2).reference(x, 0.0).dx == pytest.approx(0.4 * error)
    whole = Planner(replace(square, feedback_gain=7.0)).reference(x, 0.0)
    assert (whole.error == whole.x_d - x).all()
    assert whole.dx == pytest.approx(7.0 * error)  # Eq. (37)


def test_segments_follow_each_other_and_the_last_one_finishes(square):
    references = follow(Planner(square), square.waypoints[0], 1600)
    segments = column(references, 'segment')[[0, 499, 500, 999, 1000, 1499, 1500]]
    assert segments.tolist() == [1, 1, 2, 2, 3, 3, 3]
    finished = column(references, 'finished')
    assert not finished[:1500].any()
    assert finished[1500:].all()


def test_at_rest_holds_the_next_point_until_the_tip_arrives(square):
    planner = Planner(square)
    late = square.waypoints[0]
    for t in (0.5, 0.6, 5.0):
        reference = planner.reference(late, t)
        assert reference.segment == 1
        assert (reference.x_d == square.waypoints[1]).all()
        assert reference.dx == pytest.approx(10.0 * (square.waypoints[1] - late), abs=1e-15)
    near = square.waypoints[1] + (0.0, 0.0, 0.0009)
    reference = planner.reference(near, 5.1)
    assert reference.segment == 2
    assert (reference.x_d == square.waypoints[1]).all()  # at its own time 0
    middle = planner.reference(near, 5.35)
    assert middle.x_d == pytest.approx((square.waypoints[1] + square.waypoints[2]) / 2, abs=1e-12)


def test_within_tolerance_goes_on_before_the_time_is_over(square):
    planner = Planner(replace(square, switching='within_tolerance'))
    segments = column(follow(planner, square.waypoints[0], 600), 'segment')
    # 0.1 m to go and 1 mm tolerance: 1 - s(xi) = 0.01 at xi = 0.89
    assert np.argmax(segments == 2) == pytest.approx(0.89 * 500, abs=5)


def test_within_tolerance_does_not_skip_points_in_one_tick(square):
    points = square.waypoints[[0, 1, 1, 2]]
    planner = Planner(replace(square, switching='within_tolerance', waypoints=points))
    segments = [planner.reference(points[1], t).segment for t in (0.0, 0.4, 0.401)]
    assert segments == [1, 2, 3]


def test_the_last_point_is_held_with_feedback(square):
    planner = Planner(square)
    follow(planner, square.waypoints[0], 1501)
    reference = planner.reference(square.waypoints[-1] + (0.05, 0.0, 0.0), 100.0)
    assert reference.finished
    assert (reference.x_d == square.waypoints[-1]).all()
    assert reference.dx == pytest.approx((-0.5, 0.0, 0.0), abs=1e-12)


def test_what_a_singularity_blocks_keeps_no_segment_from_ending_but_the_last(square):
    planner = Planner(square)
    below = np.array((0.0, 0.0, -0.02))
    blocked = np.array((0.0, 0.0, 0.2))  # all of k_P e
    beside = square.waypoints[1] + below
    planner.reference(square.waypoints[0], 0.0)
    for t, unachieved in ((0.6, None), (0.7, np.zeros(3))):
        assert planner.reference(beside, t, unachieved=unachieved).segment == 1
    assert planner.reference(beside, 0.8, unachieved=blocked).segment == 2
    assert planner.reference(square.waypoints[2], 1.3).segment == 3
    assert not planner.reference(square.waypoints[3] + below, 9.0, unachieved=blocked).finished


@pytest.mark.parametrize(('offset', 'turn'), [(0.6, 0.0), (0.6, 2.0), (0.0, 2.0)])
def test_the_approach_is_no_faster_than_the_task(square, offset, turn):
    start = square.waypoints[0] + (0.0, offset, 0.0)
    R = turned((0.0, 0.0, turn))[0]
    task = replace(square, orientations=np.tile(EYE, (4, 1, 1)), feedback_gain=0.0)
    planner = Planner(task, start, R)
    references = [planner.reference(start, 0.01 * k, R) for k in range(400)]
    assert set(column(references, 'segment')) == {0}
    v, w = np.split(column(references, 'dx'), 2, axis=1)
    fastest = 15.0 / 8.0 * np.hypot(0.1, 0.1) / 0.5  # on the way to x_3
    lever = 0.1  # [m] on which a turn counts
    speeds = np.maximum(np.linalg.norm(v, axis=1), lever * np.linalg.norm(w, axis=1))
    assert speeds.max() == pytest.approx(fastest, rel=1e-3)


@pytest.mark.parametrize('start', [None, np.array((0.4, 0.004, 0.5))])
def test_a_tip_that_starts_at_the_first_point_has_no_approach(square, start):
    reference = Planner(square, start).reference(square.waypoints[0], 0.0)
    assert reference.segment == 1
    assert (reference.x_d == square.waypoints[0]).all()


@pytest.mark.parametrize('t', [0.0, 0.25, 9.0])
def test_what_is_done_to_a_reference_does_not_reach_the_planner(square, t):
    planner = Planner(square)
    expected, changed = (planner.reference(square.waypoints[0], t) for _ in range(2))
    for array in (changed.dx, changed.x_d, changed.error):
        array[:] = np.nan
    again = planner.reference(square.waypoints[0], t)
    for name in ('dx', 'x_d', 'error'):
        assert (getattr(again, name) == getattr(expected, name)).all()


@pytest.mark.parametrize('t', [0.1, 0.25, 0.4])
def test_the_orientation_goes_along_the_shortest_arc_by_the_same_quintic(turning, t):
    reference = Planner(turning).reference(turning.waypoints[0], t, EYE)
    expected = (0.5 * quintic(t / 0.5)[0], 0.0, 0.0)
    assert Rotation.from_matrix(reference.R_d).as_rotvec() == pytest.approx(expected, abs=1e-12)


def test_a_tip_that_turns_as_it_is_commanded_follows_the_orientation(turning):
    references = follow(Planner(turning), turning.waypoints[0], 1600, EYE)
    errors = np.linalg.norm(column(references, 'orientation_error'), axis=1)
    assert errors.max() < 1e-3  # T times the change of the angular velocity, over k_P
    assert references[-1].finished
    assert (references[-1].R_d == turning.orientations[-1]).all()


def test_a_preview_of_a_long_task_turns_only_through_what_it_shows(turning):
    points = np.tile(turning.waypoints, (50, 1))
    turns = np.tile(turning.orientations, (50, 1, 1))
    planner = Planner(replace(turning, waypoints=points, orientations=turns))
    with mock.patch.object(planner_module, 'rotation_error', wraps=rotation_error) as turn:
        planner.preview(0.0, 0.1)  # at three times
    assert turn.call_count == 3


def test_a_point_is_reached_only_with_its_orientation(turning):
    planner = Planner(turning)
    end = turning.waypoints[1]
    askew = turned((0.5 - 0.011, 0.0, 0.0))[0]
    states = ((0.0, EYE), (0.6, askew), (0.7, turning.orientations[1]))
    assert [planner.reference(end, t, R).segment for t, R in states] == [1, 1, 2]


def test_a_position_deviates_from_the_line_of_its_segment_alone(square):
    start, end = square.waypoints[:2]
    on_the_line = start + np.array((0.2, 0.7, 1.1))[:, None] * (end - start)
    across = on_the_line + np.array((0.0, 0.0, 0.003))
    assert square.path_deviation(on_the_line, np.ones(3)) == pytest.approx(np.zeros(3), abs=1e-15)
    assert square.path_deviation(across, np.ones(3)) == pytest.approx(np.full(3, 0.003))
    assert not square.path_deviation(across, np.zeros(3)).any()  # before x_0: no line


# At the second speed the braking distance decides; the first target has a time
@pytest.mark.parametrize(('speed', 'due'), [(0.2, 2.7), (2.0, 1.0)])
def test_a_tip_follows_a_jumping_target_within_speed_and_acceleration(square, speed, due):
    random = np.random.default_rng(3)
    x = square.waypoints[0]
    follower = TargetFollower(square, x, EYE, np.zeros(6), speed=speed)
    positions = []
    for k in range(8000):
        if k % 500 == 0 and k < 2500:
            target = square.waypoints[0] + random.normal(0.0, 0.3, 3)
            first = [0.0 if k else due]
            follower.set_path(Preview(first, [target], turned(random.normal(0.0, 1.0, 3))))
        positions.append(follower.reference(x, k * T, EYE).x_d)
    v = np.diff(positions, axis=0) / T
    a = np.diff(v, axis=0) / T
    assert 0.2 * (1.0 - 1e-3) < np.linalg.norm(v, axis=1).max() < speed * (1.0 + 1e-3)
    assert np.linalg.norm(a, axis=1).max() == pytest.approx(1.0, rel=1e-3)
    to_go = np.linalg.norm(target - positions[3500:], axis=1)
    assert to_go[-1] < square.tolerance
    assert np.diff(to_go).max() < 1e-9  # it does not overshoot


def policy(t: np.ndarray) -> Preview:
    """What a learned policy has for these times: no faster than 0.11 m/s, nor 0.2 m/s^2."""
    x = np.column_stack((0.4 + 0.05 * np.sin(2.0 * t), 0.05 * np.cos(2.0 * t), 0.5 + 0.03 * t))
    return Preview(t, x, turned(*np.column_stack((0.3 * np.sin(2.0 * t), 0.1 * t, 0.0 * t))))


def resting(task: WaypointTask, path: Preview) -> TargetFollower:
    """A follower at rest at the first pose of a path."""
    R = path.rotations[0].reshape(3, 3)
    return TargetFollower(task, path.positions[0], R, np.zeros(6), speed=0.2)


def ideally(follower: TargetFollower, ts: np.ndarray, piece: Any = None) -> list[Reference]:
    """References of a tip without an error, which takes a piece of a path, if any, at each time."""
    references = []
    x = np.zeros(3)
    R = EYE
    for t in ts:
        reference = follower.reference(x, t, R)
        references.append(follower.reference(reference.x_d, t, reference.R_d))
        if piece and (path := piece(t)):
            follower.set_path(path)
    return references


def test_the_tip_is_at_each_pose_of_a_path_at_its_time_and_at_rest_at_the_end(square):
    path = policy(np.array((0.2, 0.3, 0.34, 0.5, 0.55, 0.7)))
    follower = resting(square, path)
    follower.set_path(path)
    references = ideally(follower, path.times)
    assert column(references, 'x_d') == pytest.approx(path.positions, abs=1e-9)
    assert column(references, 'R_d').reshape(-1, 9) == pytest.approx(path.rotations, abs=1e-9)
    assert references[-1].dx == pytest.approx(np.zeros(6), abs=1e-9)
    assert column(references, 'finished').tolist() == [False] * 5 + [True]


def test_velocity_and_acceleration_of_a_path_are_continuous_at_its_poses(square):
    times = np.array((0.0, 1.0, 1.4, 3.0, 4.0))
    turns = turned(*np.random.default_rng(1).normal(0.0, 1.0, (5, 3)))
    path = Preview(times, policy(times).positions, turns)
    follower = resting(square, path)
    follower.set_path(path)
    h = 1e-5
    around = [each + k * h for each in times[1:] for k in (-2, -1, 0, 1, 2)]
    dx = column(ideally(follower, np.array(around)), 'dx').reshape(4, 5, 6)
    accelerations = np.diff(dx, axis=1) / h
    # They change by the jerk times h: 60 / (0.4 s)^3 times some 2 rad
    assert np.abs(np.diff(accelerations, axis=1)).max() < 0.1


@pytest.mark.parametrize('times', [(0.5, 1.5, 1.6, 2.6, 2.7), (0.5, 0.51, 1.5, 1.51, 2.5)])
def test_a_path_of_very_different_intervals_does_not_swing_out_of_its_chords(square, times):
    points = np.outer((0.0, 0.02, 0.04, 0.06, 0.08), (1.0, 0.5, 0.0))
    path = Preview(np.array(times), points, turned(*np.zeros((5, 3))))
    follower = resting(square, path)
    follower.set_path(path)
    for k in range(4):
        x = column(ideally(follower, np.linspace(times[k], times[k + 1], 50)), 'x_d')
        assert ((x >= points[k] - 1e-6) & (x <= points[k + 1] + 1e-6)).all()


@pytest.mark.parametrize('rate', [10.0, 25.0, 60.0])
@pytest.mark.parametrize('noise', [0.0, 0.005])  # [m] between a piece and the next
def test_overlapping_pieces_of_a_path_make_no_step_of_position_or_velocity(square, rate, noise):
    random = np.random.default_rng(5)
    follower = resting(square, policy(np.zeros(1)))
    due = [0.0]

    def piece(t: float) -> Preview | None:
        if t < due[0]:
            return None
        due[0] += 1.0 / rate
        path = policy(np.ceil(t / 0.02 + random.uniform(-3.0, 3.0)) * 0.02 + 0.02 * np.arange(25))
        moved = path.positions + random.normal(0.0, noise, 3)
        return Preview(path.times - t, moved, path.rotations.reshape(-1, 3, 3))

    references = ideally(follower, np.arange(0.0, 3.0, T), piece)[2000:]
    x = column(references, 'x_d')
    v = np.diff(x, axis=0) / T
    # Of the policy 0.2 m/s^2; of the follower 1 m/s^2 for each piece that is elsewhere
    assert np.linalg.norm(np.diff(v, axis=0), axis=1).max() / T < (1.25 if noise else 0.21)
    expected = policy(np.arange(2.0, 3.0, T))
    assert np.abs(x - expected.positions).max() < 4.0 * noise + 1e-5
    if not noise:
        turns = column(references, 'R_d').reshape(-1, 9)
        assert turns == pytest.approx(expected.rotations, abs=1e-4)


def test_a_piece_that_begins_elsewhere_is_joined_at_no_more_than_the_speed(square):
    follower = resting(square, policy(np.zeros(1)))
    times = 0.02 * np.arange(100)
    follower.set_path(policy(times))

    def piece(t: float) -> Preview | None:
        if t != 0.6:
            return None
        path = policy(0.6 + times)
        above = path.positions + np.array((0.0, 0.0, 0.2))
        return Preview(path.times - 0.55, above, path.rotations.reshape(-1, 3, 3))

    ts = np.round(np.arange(0.0, 2.2, T), 6)
    x = column(ideally(follower, ts, piece), 'x_d')
    v = np.diff(x, axis=0) / T
    assert np.linalg.norm(v, axis=1).max() < 0.11 + 0.2 * (1.0 + 1e-3)
    assert np.linalg.norm(np.diff(v[300:], axis=0), axis=1).max() / T < 1.25
    assert np.linalg.norm(x[-1] - policy(ts[-1:] - 0.05).positions - (0.0, 0.0, 0.2)) < 0.005


def test_the_preview_is_the_path_that_is_known_beyond_the_horizon_of_any_law(square):
    path = policy(0.05 * np.arange(101))
    follower = resting(square, path)
    follower.set_path(path)
    preview = follower.preview(0.0, 10.2)
    assert preview.times[-1] >= 10.2
    known = preview.times <= 5.0
    expected = policy(preview.times[known]).positions
    assert preview.positions[known][2:] == pytest.approx(expected[2:], abs=1e-3)
    assert np.abs(preview.positions[~known] - path.positions[-1]).max() < 1e-9


def test_the_orientation_stays_one_however_many_targets_come(square):
    random = np.random.default_rng(7)
    follower = resting(square, policy(np.zeros(1)))
    for k in range(500):
        R = follower.reference(square.waypoints[0], 0.016 * k, EYE).R_d
        follower.set_target(random.normal(0.0, 0.3, 3), turned(random.normal(0.0, 0.3, 3))[0])
    assert R @ R.T == pytest.approx(EYE, abs=1e-12)


def test_a_path_turns_by_more_than_a_full_turn_at_its_own_speed(square):
    times = np.arange(0.0, 5.0, 0.1)
    R = turned(*np.outer(2.0 * times, (0.0, 0.6, 0.8)))  # 2 rad/s
    follower = TargetFollower(square, square.waypoints[0], EYE, np.zeros(6), speed=0.2)
    follower.set_path(Preview(times, np.tile(square.waypoints[0], (50, 1)), R))
    dx = column(ideally(follower, np.arange(0.3, 4.7, 0.01)), 'dx')
    assert dx[:, 3:] == pytest.approx(np.tile((0.0, 1.2, 1.6), (len(dx), 1)), abs=1e-6)


@pytest.mark.parametrize('shape', [(0, 3), (1, 3), (4, 2), (4, 3, 3)])
def test_a_task_of_too_few_points_or_no_rotations_is_refused_by_name(square, shape):
    name = 'orientations' if len(shape) == 3 else 'waypoints'
    with pytest.raises(ArrayError, match=f'{name} of a task are .* expected'):
        replace(square, **{name: np.zeros(shape)})


def test_a_task_takes_lists_as_arrays(square):
    task = replace(square, times=[0.0, 0.1, 0.2, 0.3], orientations=[EYE.tolist()] * 4)
    assert (source_of(task, None, None).reference(np.zeros(3), 0.3, EYE).R_d == EYE).all()
