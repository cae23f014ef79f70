"""JointPath: a joint-space motion from rest to rest, within velocities and accelerations."""

from collections.abc import Callable

import numpy as np
import pytest

from redres_ros import Controller, RobotModel
from redres_ros.loop.holding import approach_velocity
from redres_ros.planning.joint_path import JointPath, path_to

T = 0.001  # [s]
V = np.array((1.0, 2.0, 0.5))  # [rad/s]
A = np.array((4.0, 3.0, 5.0))  # [rad/s^2]
START = np.array((0.3, -1.0, 2.0))
TURN = 2.0 * np.pi


def random_ends() -> np.ndarray:
    random = np.random.default_rng(4)
    return START + random.normal(0.0, 1.5, (50, 3)) * random.choice((0.01, 1.0), (50, 1))


@pytest.mark.slow
def test_no_joint_is_faster_than_it_may_be_and_one_is_as_fast_if_that_takes_longest() -> None:
    for end in random_ends():
        path = JointPath(START, end, V, A)
        times = np.arange(0.0, path.duration + T, T)
        q = np.array([path.reference(START, t).q_d for t in times])
        speed = np.abs(np.diff(q, axis=0) / T).max(axis=0) / V
        acceleration = np.abs(np.diff(q, 2, axis=0) / T**2).max(axis=0) / A
        used = max(speed.max(), acceleration.max())
        assert used < 1.0 + 1e-6
        assert used > 0.99 or path.duration == pytest.approx(0.5)  # T cuts the peaks off


def follow(path: JointPath, q: np.ndarray, seen: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Final positions of ideal joints; `seen` is what their driver reports."""
    t = 0.0
    while not (reference := path.reference(seen(q), t)).finished:
        assert t < path.duration + 5.0
        q = q + T * reference.dq
        t += T
    return q


def test_feedback_brings_a_joint_that_is_elsewhere_to_the_end_within_the_velocities() -> None:
    end = random_ends()[1]
    path = JointPath(START, end, V, A)
    assert follow(path, START + 0.2, lambda q: q) == pytest.approx(end, abs=0.005)
    far = path.reference(START + np.array((1.0, -2.0, 0.1)), 0.0)
    assert np.abs(far.dq / V).max() == pytest.approx(1.0)


def test_a_driver_of_one_turn_does_not_disturb_a_joint_of_several() -> None:
    turning = np.array((False, True, False))
    end = START + np.array((0.1, -3.0, 0.1))  # passes -pi
    path = JointPath(START, end, V, A, turning)

    def of_one_turn(q: np.ndarray) -> np.ndarray:
        return np.where(turning, np.remainder(q + np.pi, TURN) - np.pi, q)

    assert follow(path, START, of_one_turn) == pytest.approx(end, abs=0.005)


def test_an_arm_that_is_there_needs_no_path() -> None:
    model = RobotModel.named('lwr4_paper')
    q = np.array(model.arm.start)
    assert path_to(model, q + 0.019, q) is None
    assert path_to(model, q + 0.021, q) is not None


def test_a_joint_of_several_turns_goes_the_shortest_way_within_its_range() -> None:
    model = RobotModel.named('gen3')  # joints 1, 3, 5, 7 turn once to each side
    home = np.array(model.arm.start)
    home[0] -= 1.0
    q = home.copy()
    q[:5:2] += TURN - 0.5
    path = path_to(model, q, home)
    # Joints 3 and 5 have their home in the middle, so a turn from there is where the range ends.
    turns = (path.reference(q, path.duration).q_d - home) / TURN
    assert turns == pytest.approx((1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), abs=1e-9)


def test_an_approach_takes_the_reference_to_where_the_arm_was_measured() -> None:
    model = RobotModel.named('fr3')
    controller = Controller(model, 'minimum_velocity', T)
    start = np.array(model.arm.start)
    controller.hold_at(start)
    q = start + 0.02 * np.cos(np.arange(model.n))
    controller.follow_joints(True)
    ticks = 0
    while np.abs(controller.reference - q).max() > 1e-6:
        controller.update(start, approach_velocity(controller, q))
        ticks += 1
        assert ticks < 2000
