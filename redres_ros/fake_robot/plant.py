"""The simulated arm: in MuJoCo, or ideal."""

from collections.abc import Sequence

import mujoco
import numpy as np

from redres_ros.errors import ArrayError, RangeError, RedresError, UnknownNameError
from redres_ros.fake_robot.environment import ContactForce, EnvironmentSettings, contact_forces
from redres_ros.fake_robot.mujoco_arm import SERVO_GROUP, MujocoSettings, joint_range, servo_model
from redres_ros.robots import Arm


class IdealPlant:
    """An arm that reaches its reference exactly one cycle later: the paper's assumption.

    Args:
        joint_names: Names of the joints, in the order of every array.
        period: The cycle [s].
        q0: Initial position, (n,) [rad].

    Raises:
        ArrayError: A start of another length, or one that is not finite.
    """

    def __init__(self, joint_names: Sequence[str], period: float, q0: np.ndarray) -> None:
        self.joint_names = tuple(joint_names)
        self.period = period
        self.reset(q0)

    def reset(self, q: np.ndarray) -> None:
        """Rest at q (n,) [rad]. Raises ArrayError."""
        self._q = _finite_vector(q, len(self.joint_names), 'q')
        self._dq = np.zeros_like(self._q)

    @property
    def q(self) -> np.ndarray:
        """Joint positions, (n,) [rad]."""
        return self._q.copy()

    @property
    def dq(self) -> np.ndarray:
        """Mean joint velocities of the last cycle, (n,) [rad/s]."""
        return self._dq.copy()

    def step(self, q_ref: np.ndarray) -> None:
        """Move to q_ref (n,) [rad]."""
        self._dq = (q_ref - self._q) / self.period
        self._q = np.array(q_ref, dtype=np.float64)

    def check_link(self, link: str) -> None:
        """Accept any link: an ideal arm does not yield."""

    def push(self, force: np.ndarray, link: str = '') -> None:
        """Do nothing: an ideal arm does not yield to forces.

        Args:
            force: (3,) [N] in the base frame.
            link: Its name; '' is the tip.
        """

    @property
    def wrench(self) -> np.ndarray:
        """Force and moment on the tip, (6,) [N], [Nm]: none."""
        return np.zeros(6)

    @property
    def effort(self) -> np.ndarray | None:
        """Torques of the motors: unknown."""
        return None

    @property
    def external_torques(self) -> np.ndarray:
        """Joint torques of the forces from outside, (n,) [Nm]: none."""
        return np.zeros_like(self._q)


class MujocoPlant:
    """An arm in MuJoCo behind position servos.

    Within a cycle the reference moves on a straight line from the last one to the new one. Its
    velocity is fed forward, as in the fine interpolation of the real controller, and so is the
    torque of Eq. (6) for its acceleration. Gravity is compensated at every plant step; what is left
    is left to the servos. All stay within the URDF's effort limits, joints within their range.

    The servos are scaled to the arm instead of having one stiffness for all joints: without rotor
    inertias the last joint has a thousandth of the first one's. With k = D w^2 and d = 2 D w, where
    w is the bandwidth and D bounds the inertia matrix, no mode is ever underdamped. At w = 100
    rad/s the tip follows the paper's task to 1 um, and to 0.12 mm where a joint jumps, as the law
    of least velocity asks of it beside the stretched arm.

    KUKA's joint torque loop takes most of the friction out, so by default there is none. With it
    the tip lags by 0.65 mm, and a cycle takes half as long again.

    Args:
        arm: Whose description is simulated.
        period: The cycle [s].
        q0: Initial position, at rest, (n,) [rad].
        settings: Below the level of the reference.
        environment: What the tip can touch; None: nothing.

    Raises:
        RedresError: If the period is not a whole number of plant steps.
        FileError: If MuJoCo cannot use the URDF.
        UnknownNameError: If the URDF lacks the tip frame.
        ArrayError: A start of another length, or one that is not finite.
        RangeError: A start outside the limits.
    """

    def __init__(
        self,
        arm: Arm,
        period: float,
        q0: np.ndarray,
        settings: MujocoSettings | None = None,
        environment: EnvironmentSettings | None = None,
    ) -> None:
        settings = settings or MujocoSettings()
        self._substeps = _whole_steps(period, settings.plant_step)
        self._model = servo_model(arm, settings, environment or EnvironmentSettings())
        self._data = mujoco.MjData(self._model)
        self._tip = self._model.body(arm.tip_frame).id
        self._pushed = self._tip  # the body
        self.period = period
        self.joint_names = tuple(self._model.joint(j).name for j in range(self._model.njnt))
        self._reference = np.zeros(self._model.nq)  # (n,) [rad] at the end of the last cycle
        self._velocity = np.zeros(self._model.nq)  # (n,) [rad/s] of it in the last cycle
        self.reset(q0)

    @property
    def q(self) -> np.ndarray:
        """Joint positions, (n,) [rad]."""
        return self._data.qpos.copy()

    @property
    def dq(self) -> np.ndarray:
        """Joint velocities, (n,) [rad/s]."""
        return self._data.qvel.copy()

    def step(self, q_ref: np.ndarray) -> None:
        """Move for one cycle, during which the reference goes on to q_ref (n,) [rad]."""
        velocity = (q_ref - self._reference) / self.period  # (n,)
        torque = self._inertial_torque((velocity - self._velocity) / self.period)
        self._data.act[:] = self._reference  # the servos' reference; MuJoCo integrates it with ctrl
        self._data.ctrl[:] = np.concatenate((velocity, velocity, torque))
        mujoco.mj_step(self._model, self._data, self._substeps)
        self._reference = np.array(q_ref, dtype=np.float64)
        self._velocity = velocity

    def step_torque(self, torque: np.ndarray) -> None:
        """Move for one cycle without servos, by torques (n,) [Nm] beside those of its weight."""
        at_rest = np.zeros(2 * self._model.nq)
        self._data.ctrl[:] = np.concatenate((at_rest, torque))
        self._model.opt.disableactuator = 1 << SERVO_GROUP
        mujoco.mj_step(self._model, self._data, self._substeps)
        self._model.opt.disableactuator = 0
        self._reference = self.q
        self._velocity = self.dq

    def check_link(self, link: str) -> None:
        """Raise UnknownNameError for a link that the arm does not have; '' is the tip."""
        names = [self._model.body(body).name for body in range(1, self._model.nbody)]
        if link and link not in names:
            raise UnknownNameError('link', link, names)

    def push(self, force: np.ndarray, link: str = '') -> None:
        """Push a link, at its origin, until the next call or `reset`.

        Args:
            force: (3,) [N] in the base frame.
            link: Its name; '' is the tip.
        """
        data = self._data
        body = self._model.body(link).id if link else self._tip
        data.xfrc_applied[self._pushed] = 0.0
        self._pushed = body
        # at the body's centre of mass: it takes a torque to have it at the origin
        data.xfrc_applied[body, :3] = force
        data.xfrc_applied[body, 3:] = np.cross(data.xpos[body] - data.xipos[body], force)

    @property
    def wrench(self) -> np.ndarray:
        """Force and moment on the tip from outside, along the tip's axes, (6,) [N], [Nm]."""
        data = self._data
        tip = self._tip
        forces = contact_forces(self._model, data, tip)
        forces.append(ContactForce(data.xpos[tip], data.xfrc_applied[tip, :3]))
        force = np.zeros(3)
        moment = np.zeros(3)
        for each in forces:
            force += each.force
            moment += np.cross(each.point - data.xpos[tip], each.force)
        R = data.xmat[tip].reshape(3, 3)
        return np.concatenate((R.T @ force, R.T @ moment))

    @property
    def effort(self) -> np.ndarray:
        """Torques of the motors, (n,) [Nm], as sensors behind the gears measure them."""
        return self._data.qfrc_actuator.copy()

    @property
    def external_torques(self) -> np.ndarray:
        """Joint torques of the forces from outside, (n,) [Nm]: J' f of contacts and of a push."""
        data = self._data
        pushed = self._pushed
        torques = np.zeros(self._model.nv)
        push = ContactForce(data.xpos[pushed], data.xfrc_applied[pushed, :3])
        self._add_torques(pushed, push, torques)
        for contact in contact_forces(self._model, data, self._tip):
            self._add_torques(self._tip, contact, torques)
        return torques

    def reset(self, q: np.ndarray) -> None:
        """Stand still at q (n,) [rad]. Raises ArrayError, or RangeError outside the limits."""
        q = _finite_vector(q, self._model.nq, 'q')
        for name, value, lower, upper in zip(
            self.joint_names, q, *joint_range(self._model, np.inf), strict=True
        ):
            if not lower <= value <= upper:
                raise RangeError(name, value, lower, upper, 'rad')
        mujoco.mj_resetData(self._model, self._data)
        self._data.qpos[:] = q
        mujoco.mj_fwdPosition(self._model, self._data)  # where a push would act, and the inertia
        self._reference = q
        self._velocity = np.zeros_like(q)

    def _add_torques(self, body: int, contact: ContactForce, torques: np.ndarray) -> None:
        """Add those of a force on a body to the torques (n,) [Nm].

        Args:
            body: Its number.
            contact: Point and force.
            torques: Changed.
        """
        no_moment = np.zeros(3)
        mujoco.mj_applyFT(
            self._model, self._data, contact.force, no_moment, contact.point, body, torques
        )

    def _inertial_torque(self, ddq: np.ndarray) -> np.ndarray:
        """M(q) ddq and the Coriolis and centrifugal torques, (n,) [Nm], for ddq (n,) [rad/s^2]."""
        data = self._data
        torque = np.empty(len(ddq))
        mujoco.mj_mulM(self._model, data, torque, ddq)
        return torque + data.qfrc_bias - data.qfrc_gravcomp  # the servos have gravity already


def _whole_steps(period: float, step: float) -> int:
    steps = round(period / step)
    if not (steps >= 1 and abs(period / step - steps) < 1e-6 * steps):
        raise RedresError(
            f'rate {1.0 / period:.1f} Hz gives a cycle of {1e3 * period:.4g} ms, which is not a '
            f'whole number of plant steps of {1e3 * step:g} ms'
        )
    return steps


def _finite_vector(value: np.ndarray, n: int, name: str) -> np.ndarray:
    vector = np.array(value, dtype=np.float64)
    if vector.shape != (n,) or not np.isfinite(vector).all():
        raise ArrayError(f'{name} is {vector.tolist()}; expected {n} finite values')
    return vector
