"""An arm as another library has it, to hold ours against."""

import mujoco
import numpy as np
from doubles import random_motion

from redres_ros import RobotModel
from redres_ros.fake_robot.mujoco_arm import compiled, load
from redres_ros.robots import Arm

AGREEMENT = 1e-9  # two libraries in double precision, numbers up to some hundreds


class ReferenceModel:
    """Kinematics and dynamics of an arm as MuJoCo computes them, to hold against another library.

    The base frame is the root link. Raises FileError if MuJoCo cannot use the URDF,
    UnknownNameError if it lacks the tip frame.
    """

    def __init__(self, arm: Arm) -> None:
        self._model = compiled(load(arm), arm)
        self._data = mujoco.MjData(self._model)
        self._tip = self._model.body(arm.tip_frame).id

    def kinematics(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Tip position (3,) [m], orientation (3, 3) and Jacobian (6, n), linear rows first, in the
        base frame.
        """
        data = self._data
        n = self._model.nv
        self._forward(q, np.zeros(n))
        J = np.zeros((6, n))
        mujoco.mj_jacBody(self._model, data, J[:3], J[3:], self._tip)
        return data.xpos[self._tip].copy(), data.xmat[self._tip].reshape(3, 3).copy(), J

    def dynamics(self, q: np.ndarray, dq: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """M(q) with rotors, (n, n) [kg m^2], and n(q, dq), (n,) [Nm]."""
        self._forward(q, dq)
        M = np.empty((len(q), len(q)))
        mujoco.mj_fullM(self._model, self._data, M)
        return M, self._data.qfrc_bias.copy()

    def _forward(self, q: np.ndarray, dq: np.ndarray) -> None:
        self._data.qpos[:] = q
        self._data.qvel[:] = dq
        mujoco.mj_fwdPosition(self._model, self._data)
        mujoco.mj_fwdVelocity(self._model, self._data)


def assert_libraries_agree(arm: Arm) -> None:
    """All of an arm's kinematics and dynamics are the same in Pinocchio and in MuJoCo."""
    model, reference = RobotModel(arm), ReferenceModel(arm)
    for q, dq in random_motion(model.n, 100):
        state = model.state(q, dq)
        seen = reference.kinematics(q) + reference.dynamics(q, dq)
        for got, expected in zip((state.x, state.R, state.J, state.M, state.n), seen, strict=True):
            assert np.abs(got - expected).max() < AGREEMENT
        assert np.linalg.eigvalsh(state.M)[0] > 0.0
