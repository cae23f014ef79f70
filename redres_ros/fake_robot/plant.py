"""The simulated arm: in MuJoCo, or ideal; and either as its faulty sensors show it."""

from collections.abc import Iterator, Sequence

import mujoco
import numpy as np

from redres_ros.errors import RangeError, RedresError, UnknownNameError
from redres_ros.fake_robot.faults import Faults
from redres_ros.fake_robot.mujoco_arm import PLANT_STEP, EnvironmentSettings, servo_model
from redres_ros.robots import Arm
from redres_ros.types import (
    Force,
    JointPositions,
    JointTorques,
    Position,
    Seconds,
    Wrench,
    finite_vector,
)

_BRAKES = 1e8  # [N m s/rad] damping of a joint whose brakes are on
_SENSOR_BIAS = 5.0  # [N] of a faulty force sensor, along the tip's z


class IdealPlant:
    """The paper's ideal arm: at its reference a cycle later. Raises ArrayError for a bad start."""

    links: tuple[str, ...] = ()  # any may be pushed
    effort = None  # torques of the motors: unknown

    def __init__(self, joint_names: Sequence[str], period: Seconds, q0: JointPositions) -> None:
        self.joint_names = tuple(joint_names)
        self.period = period
        self.q = finite_vector(q0, len(self.joint_names), 'start')
        self.dq = np.zeros_like(self.q)
        self.wrench = np.zeros(6)
        self.external_torques = np.zeros_like(self.q)

    def step(self, q_ref: JointPositions, braked: bool = False) -> None:
        q_ref = self.q if braked else q_ref
        self.dq = (q_ref - self.q) / self.period
        self.q = q_ref

    def push(self, force: Force, link: str = '') -> None:
        """Do nothing."""


class MujocoPlant:
    """An arm in MuJoCo behind position servos, at rest at q0.

    Within a cycle the reference moves on a straight line from the last one to the new one. Its
    velocity is fed forward, as in the fine interpolation of the real controller, and so is the
    torque of Eq. (6) for its acceleration. Gravity is compensated at every plant step; the servos
    do the rest. All stay within the URDF's effort limits, joints within their range. At a servo
    bandwidth of 100 rad/s the tip follows the paper's task to 1 um, and to 0.12 mm where a joint
    jumps.

    Raises RedresError for a period that is not a whole number of plant steps, ArrayError or
    RangeError for a start outside the limits, and as `servo_model`.
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
        self._substeps = round(period / PLANT_STEP)
        if not abs(period / PLANT_STEP - self._substeps) < 1e-6 * self._substeps:
            raise RedresError(
                f'rate {1.0 / period:.1f} Hz gives a cycle of {1e3 * period:.4g} ms, which is not '
                f'a whole number of plant steps of {1e3 * PLANT_STEP:g} ms'
            )
        self._model = servo_model(arm, environment or EnvironmentSettings(), servo_bandwidth)
        self._data = mujoco.MjData(self._model)
        self._tip = self._model.body(arm.tip_frame).id
        self._pushed = self._tip  # the body
        self.period = period
        self.joint_names = tuple(self._model.joint(j).name for j in range(self._model.njnt))
        self.links = tuple(self._model.body(body).name for body in range(1, self._model.nbody))
        self.q = finite_vector(q0, self._model.nq, 'start')
        for joint, value in enumerate(self.q):
            lower, upper = self._model.jnt_range[joint]
            if self._model.jnt_limited[joint] and not lower <= value <= upper:
                raise RangeError(self.joint_names[joint], value, lower, upper, 'rad')
        self.dq = np.zeros_like(self.q)
        self._reference = self.q  # (n,) [rad] at the end of the last cycle
        self._velocity = self.dq  # (n,) [rad/s] of the reference in the last cycle
        self._data.qpos[:] = q0
        mujoco.mj_fwdPosition(self._model, self._data)  # where a push would act, and the inertia

    def step(self, q_ref: JointPositions, braked: bool = False) -> None:
        """Move for one cycle, during which the reference goes on to q_ref; braked, it is there."""
        data = self._data
        # KUKA's joint torque loop takes most of the friction out.
        self._model.dof_damping[:] = _BRAKES if braked else 0.0
        begin = q_ref if braked else self._reference
        velocity = (q_ref - begin) / self.period  # (n,)
        torque = np.empty_like(velocity)  # Eq. (6); the servos have gravity already
        mujoco.mj_mulM(self._model, data, torque, (velocity - self._velocity) / self.period)
        torque = torque + data.qfrc_bias - data.qfrc_gravcomp
        data.act[:] = begin  # the servos' reference; MuJoCo integrates it with ctrl
        data.ctrl[:] = np.concatenate((velocity, velocity, torque))
        mujoco.mj_step(self._model, data, self._substeps)
        self._reference = q_ref
        self._velocity = velocity
        self.q = data.qpos.copy()
        self.dq = data.qvel.copy()

    def push(self, force: Force, link: str = '') -> None:
        """Push a link's origin, '': the tip, by a force in the base frame until the next call."""
        data = self._data
        data.xfrc_applied[self._pushed] = 0.0
        self._pushed = body = self._model.body(link).id if link else self._tip
        if not any(force):  # as in most cycles: the cross product would take half of a cycle's time
            return
        # at the body's centre of mass: it takes a torque to have it at the origin
        data.xfrc_applied[body, :3] = force
        data.xfrc_applied[body, 3:] = np.cross(data.xpos[body] - data.xipos[body], force)

    @property
    def wrench(self) -> Wrench:
        """Force and moment on the tip from outside, along the tip's axes."""
        wrench = np.zeros((2, 3))  # in the base frame
        for body, point, force in self._forces():
            if body == self._tip:
                wrench += (force, np.cross(point - self._data.xpos[body], force))
        R = self._data.xmat[self._tip].reshape(3, 3)
        return np.concatenate((R.T @ wrench[0], R.T @ wrench[1]))

    @property
    def effort(self) -> JointTorques:
        """Torques of motors and brakes, as sensors behind the gears measure them."""
        return self._data.qfrc_actuator + self._data.qfrc_damper

    @property
    def external_torques(self) -> JointTorques:
        """Joint torques of the forces from outside: J' f of contacts and of a push."""
        torques = np.zeros(self._model.nv)
        for body, point, force in self._forces():
            mujoco.mj_applyFT(self._model, self._data, force, np.zeros(3), point, body, torques)
        return torques

    def _forces(self) -> Iterator[tuple[int, Position, Force]]:
        """Body, point and force, in the base frame, of the contacts, all on the tip, and a push."""
        data = self._data
        in_its_frame = np.zeros(6)
        for number in range(data.ncon):
            contact = data.contact[number]
            mujoco.mj_contactForce(self._model, data, number, in_its_frame)
            force = contact.frame.reshape(3, 3).T @ in_its_frame[:3]  # on the second shape
            is_second = self._model.geom_bodyid[contact.geom[1]] == self._tip
            yield self._tip, contact.pos.copy(), force if is_second else -force
        yield self._pushed, data.xpos[self._pushed], data.xfrc_applied[self._pushed, :3]


class FaultyPlant:
    """A plant as its faulty sensors show it, without faults exactly. Raises as `check`.

    The noise of the encoders is the same for the same seed. The velocities of encoders at fault are
    differences of their positions. Other faults act from the next cycle on.
    """

    def __init__(
        self, plant: IdealPlant | MujocoPlant, faults: Faults | None = None, seed: int = 0
    ) -> None:
        self.true = plant
        self.joint_names = plant.joint_names
        self.period = plant.period
        self.q = plant.q
        self.dq = plant.dq
        self._random = np.random.default_rng(seed)
        self.faults = faults or Faults()
        self.check(self.faults)

    def check(self, faults: Faults) -> None:
        """Raise UnknownNameError for a pushed link that the arm does not have."""
        links = self.true.links
        if faults.push_link and links and faults.push_link not in links:
            raise UnknownNameError('link', faults.push_link, links)

    @property
    def wrench(self) -> Wrench | None:
        """Measured force and moment on the tip, along the tip's axes; None: it is lost."""
        fault = self.faults.wrench_fault
        if fault == 'lost':
            return None
        shown = self.true.wrench.copy()
        if fault == 'bias':
            shown[2] += _SENSOR_BIAS
        elif fault == 'not_finite':
            shown[:] = np.nan
        return shown

    def step(self, q_ref: JointPositions, braked: bool = False) -> None:
        faults = self.faults  # one for the whole cycle
        self.true.push(np.array(faults.push_force), faults.push_link)
        self.true.step(q_ref, braked)
        q = self.true.q
        if faults.encoder_noise:
            q = q + self._random.normal(0.0, faults.encoder_noise, len(q))
        if faults.encoder_step:
            q = faults.encoder_step * np.round(q / faults.encoder_step)
        self.dq = self.true.dq if q is self.true.q else (q - self.q) / self.period
        self.q = q
