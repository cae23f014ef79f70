"""Rotations: against scipy, and near half a turn, where formulas fail."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from redres_ros.geometry import (
    from_quaternion,
    from_roll_pitch_yaw,
    rotation_matrix,
    rotation_vector,
    to_quaternion,
)

RANDOM = Rotation.random(200, random_state=0)
ANGLES = (0.0, 1e-12, 1e-6, 0.5, 3.0, np.pi - 0.1, np.pi - 1e-6, np.pi - 1e-9)


def test_the_logarithm_is_that_of_scipy():
    for turn in RANDOM:
        assert rotation_vector(turn.as_matrix()) == pytest.approx(turn.as_rotvec(), abs=1e-12)


@pytest.mark.parametrize('angle', ANGLES)
def test_exponential_and_logarithm_undo_each_other(angle):
    for axis in np.random.default_rng(0).normal(size=(20, 3)):
        vector = angle * axis / np.linalg.norm(axis)
        assert rotation_vector(rotation_matrix(vector)) == pytest.approx(vector, abs=1e-9)


def test_quaternions_are_x_y_z_w():
    for turn in RANDOM:
        for length in (1e-300, 3.0, 1e300):  # the squares of which are no numbers any more
            R = from_quaternion(length * turn.as_quat())
            assert R == pytest.approx(turn.as_matrix(), abs=1e-12)


def test_a_quaternion_of_a_matrix_gives_the_matrix_back():
    for turn in RANDOM:
        R = turn.as_matrix()
        q = to_quaternion(R)
        assert from_quaternion(q) == pytest.approx(R, abs=1e-12)
        assert q[3] >= 0.0


def test_roll_pitch_and_yaw_turn_about_the_axes_of_the_base():
    for angles in np.random.default_rng(1).uniform(-3.0, 3.0, (50, 3)):
        expected = Rotation.from_euler('xyz', angles).as_matrix()
        assert from_roll_pitch_yaw(angles) == pytest.approx(expected, abs=1e-12)
