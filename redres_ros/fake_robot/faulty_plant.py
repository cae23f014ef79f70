"""An arm with faulty encoders and force sensor, with pushes, or with joints that do not move."""

from typing import TYPE_CHECKING

import numpy as np

from redres_ros.errors import RangeError
from redres_ros.fake_robot.faults import Faults

if TYPE_CHECKING:
    from redres_ros.fake_robot.plant import IdealPlant, MujocoPlant


class FaultyPlant:
    """A plant as its faulty encoders show it; without faults exactly the plant itself.

    Noise is drawn once a cycle, the same for the same seed. The velocities of encoders at fault are
    differences of their positions. While the physics are paused the plant stands still and
    receives nothing; afterwards its servos drive it to the reference as hard as they can, and an
    ideal one jumps there.

    Args:
        plant: The arm.
        faults: From the first cycle on.
        seed: Seed of the noise.

    Raises:
        RangeError: A frozen joint that the arm does not have.
        UnknownNameError: A pushed link that it does not have.
    """

    def __init__(
        self, plant: 'IdealPlant | MujocoPlant', faults: Faults | None = None, seed: int = 0
    ) -> None:
        self.joint_names = plant.joint_names
        self.period = plant.period
        self._plant = plant
        self._random = np.random.default_rng(seed)
        self._wrench_random = np.random.default_rng(seed)  # drawn as often as somebody listens
        self._q = plant.q
        self._dq = plant.dq  # (n,), as measured
        self._pushed = False  # in the last cycle
        self.faults = faults or Faults()

    @property
    def faults(self) -> Faults:
        """The faults of this arm; set, they act from the next cycle on. Raises as the constructor
        does.
        """
        return self._faults

    @faults.setter
    def faults(self, faults: Faults) -> None:
        self.check(faults)
        self._faults = faults

    def check(self, faults: Faults) -> None:
        """Raise RangeError or UnknownNameError for a frozen joint or a pushed link that the arm
        does not have.
        """
        self._plant.check_link(faults.push_link)
        if faults.frozen_joint > len(self.joint_names):
            raise RangeError('frozen_joint', faults.frozen_joint, 0, len(self.joint_names))

    @property
    def q(self) -> np.ndarray:
        """Measured joint positions, (n,) [rad]."""
        return self._q.copy()

    @property
    def dq(self) -> np.ndarray:
        """Measured joint velocities, (n,) [rad/s]."""
        return self._dq.copy()

    @property
    def wrench(self) -> np.ndarray:
        """Measured force and moment on the tip, along the tip's axes, (6,) [N], [Nm]."""
        return self._faults.measured(self._plant.wrench, self._wrench_random)

    @property
    def effort(self) -> np.ndarray | None:
        """Torques of the motors, (n,) [Nm]; None for an arm that does not measure them."""
        return self._plant.effort

    @property
    def external_torques(self) -> np.ndarray:
        """Joint torques of the forces from outside, (n,) [Nm]."""
        return self._plant.external_torques

    def step(self, q_ref: np.ndarray) -> None:
        """Move for one cycle, during which the reference goes on to q_ref (n,) [rad]; or stand
        still.
        """
        faults = self._faults  # one for the whole cycle
        if faults.paused_physics:
            self._measure(faults, self._plant.q, np.zeros_like(self._q))
            return
        self._push(faults)
        self._plant.step(q_ref)
        self._measure(faults, self._plant.q, self._plant.dq)

    def _push(self, faults: Faults) -> None:
        """Push the link where it is in this cycle; without a force leave the plant alone once the
        last push is over.
        """
        force = faults.push_force
        pushed = bool(force.any())
        if pushed or self._pushed:
            self._plant.push(force, faults.push_link)
        self._pushed = pushed

    def _measure(self, faults: Faults, q: np.ndarray, dq: np.ndarray) -> None:
        """Take what the encoders show of q, dq (n,) [rad], [rad/s]."""
        measured = q.copy()
        if faults.encoder_noise:
            measured += self._random.normal(0.0, faults.encoder_noise, len(q))
        if faults.encoder_step:
            measured = faults.encoder_step * np.round(measured / faults.encoder_step)
        if faults.frozen_joint:
            measured[faults.frozen_joint - 1] = self._q[faults.frozen_joint - 1]
        faulty = faults.encoder_noise or faults.encoder_step or faults.frozen_joint
        self._dq = (measured - self._q) / self.period if faulty else dq
        self._q = measured
