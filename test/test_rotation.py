"""Rotations: against scipy, and near half a turn, where formulas fail."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from redres_ros.geometry import from_quaternion, rotation_matrix, to_quaternion
from redres_ros.kernels.tick import rotation_error

RANDOM = Rotation.random(200, random_state=0)
ANGLES = (0.0, 1e-12, 1e-6, 0.5, 3.0, np.pi - 0.1, np.pi - 1e-6, np.pi - 1e-9)


def test_the_logarithm_is_that_of_scipy():
    for turn in RANDOM:
        error = rotation_error(np.eye(3), turn.as_matrix())
        assert error == pytest.approx(turn.as_rotvec(), abs=1e-12)


@pytest.mark.parametrize('angle', ANGLES)
def test_exponential_and_logarithm_undo_each_other(angle):
    for axis in np.random.default_rng(0).normal(size=(20, 3)):
        vector = angle * axis / np.linalg.norm(axis)
        assert rotation_error(np.eye(3), rotation_matrix(vector)) == pytest.approx(vector, abs=1e-9)


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
