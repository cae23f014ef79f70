"""The simulated arm: in MuJoCo, or ideal."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from redres_ros.errors import ArrayError, RangeError, RedresError
from redres_ros.fake_robot.mujoco_arm import (
    PLANT_STEP,
    EnvironmentSettings,
    joint_range,
    servo_model,
)
from redres_ros.robots import Arm
from redres_ros.types import (
    Force,
    JointAccelerations,
    JointPositions,
    JointTorques,
    JointVelocities,
    Position,
    Seconds,
    Wrench,
)


class IdealPlant:
    """An arm that reaches its reference exactly one cycle later: the paper's assumption. It does
    not yield to forces. Raises ArrayError for a start of another length, or one not finite.
    """

    links: tuple[str, ...] = ()  # any may be pushed
    effort = None  # torques of the motors: unknown

    def __init__(self, joint_names: Sequence[str], period: Seconds, q0: JointPositions) -> None:
        self.joint_names = tuple(joint_names)
        self.period = period
        self._q = _finite_vector(q0, len(self.joint_names))
        self._dq = np.zeros_like(self._q)

    @property
    def q(self) -> JointPositions:
        """Joint positions."""
        return self._q.copy()

    @property
    def dq(self) -> JointVelocities:
        """Mean joint velocities of the last cycle."""
        return self._dq.copy()

    def step(self, q_ref: JointPositions) -> None:
        """Move to q_ref."""
        self._dq = (q_ref - self._q) / self.period
        self._q = np.array(q_ref, dtype=np.float64)

    def push(self, force: Force, link: str = '') -> None:
        """Do nothing."""

    @property
    def wrench(self) -> Wrench:
        """Force and moment on the tip: none."""
        return np.zeros(6)

    @property
    def external_torques(self) -> JointTorques:
        """Joint torques of the forces from outside: none."""
        return np.zeros_like(self._q)


class _Force(NamedTuple):
    """A force on a body from outside, in the base frame."""

    body: int
    point: Position
    force: Force


class MujocoPlant:
    """An arm in MuJoCo behind position servos, at rest at q0.

    Within a cycle the reference moves on a straight line from the last one to the new one. Its
    velocity is fed forward, as in the fine interpolation of the real controller, and so is the
    torque of Eq. (6) for its acceleration. Gravity is compensated at every plant step; what is left
    is left to the servos. All stay within the URDF's effort limits, joints within their range.

    With k = D w^2 and d = 2 D w, where w is the bandwidth of the servos [rad/s] and D bounds the
    inertia matrix, no mode is ever underdamped. At w = 100 the tip follows the paper's task to
    1 um, and to 0.12 mm where a joint jumps.

    Raises:
        RedresError: The period is not a whole number of plant steps.
        FileError: MuJoCo cannot use the URDF.
        UnknownNameError: The URDF lacks the tip frame.
        ArrayError: A start of another length, or one that is not finite.
        RangeError: A start outside the limits.
    """

    def __init__(
        self,
        arm: Arm,
        period: Seconds,
        q0: JointPositions,
        *,
        environment: EnvironmentSettings | None = None,
        servo_bandwidth: float = 100.0,
    ) -> None:
        self._substeps = _whole_steps(period)
        self._model = servo_model(arm, environment or EnvironmentSettings(), servo_bandwidth)
        self._data = mujoco.MjData(self._model)
        self._tip = self._model.body(arm.tip_frame).id
        self._pushed = self._tip  # the body
        self.period = period
        self.joint_names = tuple(self._model.joint(j).name for j in range(self._model.njnt))
        self.links = tuple(self._model.body(body).name for body in range(1, self._model.nbody))
        self._reference = self._checked(q0)  # (n,) [rad] at the end of the last cycle
        self._velocity = np.zeros(self._model.nq)  # (n,) [rad/s] of it in the last cycle
        self._data.qpos[:] = q0
        mujoco.mj_fwdPosition(self._model, self._data)  # where a push would act, and the inertia

    @property
    def q(self) -> JointPositions:
        """Joint positions."""
        return self._data.qpos.copy()

    @property
    def dq(self) -> JointVelocities:
        """Joint velocities."""
        return self._data.qvel.copy()

    def step(self, q_ref: JointPositions) -> None:
        """Move for one cycle, during which the reference goes on to q_ref."""
        velocity = (q_ref - self._reference) / self.period  # (n,)
        torque = self._inertial_torque((velocity - self._velocity) / self.period)
        self._data.act[:] = self._reference  # the servos' reference; MuJoCo integrates it with ctrl
        self._data.ctrl[:] = np.concatenate((velocity, velocity, torque))
        mujoco.mj_step(self._model, self._data, self._substeps)
        self._reference = np.array(q_ref, dtype=np.float64)
        self._velocity = velocity

    def push(self, force: Force, link: str = '') -> None:
        """Push a link at its origin, '' for the tip, until the next call, by a force in the base
        frame.
        """
        data = self._data
        body = self._model.body(link).id if link else self._tip
        data.xfrc_applied[self._pushed] = 0.0
        self._pushed = body
        # at the body's centre of mass: it takes a torque to have it at the origin
        data.xfrc_applied[body, :3] = force
        data.xfrc_applied[body, 3:] = np.cross(data.xpos[body] - data.xipos[body], force)

    @property
    def wrench(self) -> Wrench:
        """Force and moment on the tip from outside, along the tip's axes."""
        origin = self._data.xpos[self._tip]
        force = np.zeros(3)
        moment = np.zeros(3)
        for each in self._forces():
            if each.body == self._tip:
                force += each.force
                moment += np.cross(each.point - origin, each.force)
        R = self._data.xmat[self._tip].reshape(3, 3)
        return np.concatenate((R.T @ force, R.T @ moment))

    @property
    def effort(self) -> JointTorques:
        """Torques of the motors, as sensors behind the gears measure them."""
        return self._data.qfrc_actuator.copy()

    @property
    def external_torques(self) -> JointTorques:
        """Joint torques of the forces from outside: J' f of contacts and of a push."""
        torques = np.zeros(self._model.nv)
        for each in self._forces():
            mujoco.mj_applyFT(
                self._model, self._data, each.force, np.zeros(3), each.point, each.body, torques
            )
        return torques

    def _forces(self) -> Iterator[_Force]:
        """Those of the contacts, all on the tip, and of a push."""
        data = self._data
        in_its_frame = np.zeros(6)
        for number in range(data.ncon):
            contact = data.contact[number]
            mujoco.mj_contactForce(self._model, data, number, in_its_frame)
            force = contact.frame.reshape(3, 3).T @ in_its_frame[:3]  # on the second shape
            is_second = self._model.geom_bodyid[contact.geom[1]] == self._tip
            yield _Force(self._tip, contact.pos.copy(), force if is_second else -force)
        pushed = self._pushed
        yield _Force(pushed, data.xpos[pushed], data.xfrc_applied[pushed, :3])

    def _checked(self, q0: JointPositions) -> JointPositions:
        q = _finite_vector(q0, self._model.nq)
        lower, upper = joint_range(self._model, np.inf)
        for name, value, least, most in zip(self.joint_names, q, lower, upper, strict=True):
            if not least <= value <= most:
                raise RangeError(name, value, least, most, 'rad')
        return q

    def _inertial_torque(self, ddq: JointAccelerations) -> JointTorques:
        """M(q) ddq and the Coriolis and centrifugal torques."""
        data = self._data
        torque = np.empty(len(ddq))
        mujoco.mj_mulM(self._model, data, torque, ddq)
        return torque + data.qfrc_bias - data.qfrc_gravcomp  # the servos have gravity already


def _whole_steps(period: Seconds) -> int:
    steps = round(period / PLANT_STEP)
    if not (steps >= 1 and abs(period / PLANT_STEP - steps) < 1e-6 * steps):
        raise RedresError(
            f'rate {1.0 / period:.1f} Hz gives a cycle of {1e3 * period:.4g} ms, which is not a '
            f'whole number of plant steps of {1e3 * PLANT_STEP:g} ms'
        )
    return steps


def _finite_vector(value: np.ndarray, n: int) -> JointPositions:
    vector = np.array(value, dtype=np.float64)
    if vector.shape != (n,) or not np.isfinite(vector).all():
        raise ArrayError(f'q is {vector.tolist()}; expected {n} finite values')
    return vector
