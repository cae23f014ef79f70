"""What moves when the reference does: an arm in MuJoCo, or an ideal one. The only file that imports
mujoco.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from redres_ros.errors import ArrayError, FileError, RangeError, RedresError, UnknownNameError
from redres_ros.parameter import check_parameters, param
from redres_ros.robots import Arm

SAMPLES = 200  # random positions from which the largest inertia is estimated


class IdealPlant:
    """An arm that is exactly where its reference says, one cycle later: the paper's assumption.

    Args:
        joint_names: In the order of every array.
        period: The cycle [s].
        q0: Where it stands at first, (n,) [rad].

    Raises:
        ArrayError: For a start of another length, or one that is not finite.
    """

    def __init__(self, joint_names: Sequence[str], period: float, q0: np.ndarray) -> None:
        self.joint_names = tuple(joint_names)
        self.period = period
        self.reset(q0)

    def reset(self, q: np.ndarray) -> None:
        """Stand still at q (n,) [rad]. Raises ArrayError."""
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

    def push(self, force: np.ndarray) -> None:
        """Do nothing: an arm that is where its reference says yields to no force at its tip."""

    @property
    def wrench(self) -> np.ndarray:
        """Force and moment on the tip, (6,) [N], [Nm]: none."""
        return np.zeros(6)


@dataclass(frozen=True)
class MujocoSettings:
    """The simulated arm below the level of the reference. Raises RangeError for a wrong figure."""

    plant_step: float = param(
        0.0005, 'simulation step, of which the cycle must be a whole multiple [s]', 1e-5, 0.01
    )
    servo_bandwidth: float = param(
        100.0, 'natural frequency of the position servos [rad/s]', 1.0, 1000.0
    )
    joint_friction: bool = param(
        False, 'leave joint friction to the servos, as if no joint torque loop took it out'
    )

    def __post_init__(self) -> None:
        check_parameters(self)
        if not self.servo_bandwidth * self.plant_step <= 0.5:
            raise RangeError(
                'servo_bandwidth',
                self.servo_bandwidth,
                1.0,
                0.5 / self.plant_step,
                f'rad/s at a step of {self.plant_step:g} s',
            )


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
        q0: Where it stands at first, at rest, (n,) [rad].
        settings: Below the level of the reference.

    Raises:
        RedresError: If the period is not a whole number of plant steps.
        FileError: If MuJoCo cannot use the URDF.
        UnknownNameError: If the URDF lacks the tip frame.
        ArrayError: For a start of another length, or one that is not finite.
        RangeError: For a start outside the limits.
    """

    def __init__(
        self, arm: Arm, period: float, q0: np.ndarray, settings: MujocoSettings | None = None
    ) -> None:
        settings = settings or MujocoSettings()
        self._substeps = _whole_steps(period, settings.plant_step)
        self._model = _servo_model(arm, settings)
        self._data = mujoco.MjData(self._model)
        self._tip = _tip_body(self._model, arm)
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

    def push(self, force: np.ndarray) -> None:
        """Push the tip, where it is now, with a force (3,) [N] in the base frame until the next
        call or `reset`.
        """
        data = self._data
        tip = self._tip
        # at the body's centre of mass: it takes a torque to have it at the tip
        data.xfrc_applied[tip, :3] = force
        data.xfrc_applied[tip, 3:] = np.cross(data.xpos[tip] - data.xipos[tip], force)

    @property
    def wrench(self) -> np.ndarray:
        """Force and moment on the tip from outside, along the tip's axes, (6,) [N], [Nm]."""
        data = self._data
        tip = self._tip
        R = data.xmat[tip].reshape(3, 3)
        force = data.xfrc_applied[tip, :3]
        moment = data.xfrc_applied[tip, 3:] + np.cross(data.xipos[tip] - data.xpos[tip], force)
        return np.concatenate((R.T @ force, R.T @ moment))

    def reset(self, q: np.ndarray) -> None:
        """Stand still at q (n,) [rad]. Raises ArrayError, or RangeError outside the limits."""
        q = _finite_vector(q, self._model.nq, 'q')
        for name, value, lower, upper in zip(
            self.joint_names, q, *_joint_range(self._model, np.inf), strict=True
        ):
            if not lower <= value <= upper:
                raise RangeError(name, value, lower, upper, 'rad')
        mujoco.mj_resetData(self._model, self._data)
        self._data.qpos[:] = q
        mujoco.mj_fwdPosition(self._model, self._data)  # where a push would act, and the inertia
        self._reference = q
        self._velocity = np.zeros_like(q)

    def _inertial_torque(self, ddq: np.ndarray) -> np.ndarray:
        """M(q) ddq and the Coriolis and centrifugal torques, (n,) [Nm], for ddq (n,) [rad/s^2]."""
        data = self._data
        torque = np.empty(len(ddq))
        mujoco.mj_mulM(self._model, data, torque, ddq)
        return torque + data.qfrc_bias - data.qfrc_gravcomp  # the servos have gravity already


class Witness:
    """Kinematics and dynamics of an arm as MuJoCo computes them, to hold against another library.

    The base frame is the root link. Raises FileError if MuJoCo cannot use the URDF,
    UnknownNameError if it lacks the tip frame.
    """

    def __init__(self, arm: Arm) -> None:
        self._model = _compile(_load(arm), arm)
        self._data = mujoco.MjData(self._model)
        self._tip = _tip_body(self._model, arm)

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
        """Inertia matrix, and Coriolis, centrifugal and gravity torques.

        Args:
            q: Joint positions, (n,) [rad].
            dq: Joint velocities, (n,) [rad/s].

        Returns:
            M(q), (n, n) [kg m^2], with rotors, and n(q, dq), (n,) [Nm].
        """
        self._forward(q, dq)
        return _inertia(self._model, self._data), self._data.qfrc_bias.copy()

    def _forward(self, q: np.ndarray, dq: np.ndarray) -> None:
        self._data.qpos[:] = q
        self._data.qvel[:] = dq
        mujoco.mj_fwdPosition(self._model, self._data)
        mujoco.mj_fwdVelocity(self._model, self._data)


def _load(arm: Arm) -> mujoco.MjSpec:
    """The arm's bodies and joints, inertias exactly as given; shapes are dropped, as nothing
    touches anything here.
    """
    try:
        spec = mujoco.MjSpec.from_string(arm.description())
    except ValueError as error:
        raise FileError(f'MuJoCo cannot read {arm.urdf}: {error}') from None
    for shape in (*spec.geoms, *spec.meshes):
        spec.delete(shape)
    compiler = spec.compiler
    compiler.fusestatic = False
    compiler.balanceinertia = False
    compiler.boundmass = 0.0
    compiler.boundinertia = 0.0
    if arm.armature:
        for joint, armature in zip(spec.joints, arm.armature, strict=True):
            joint.armature = armature
    return spec


def _compile(spec: mujoco.MjSpec, arm: Arm) -> mujoco.MjModel:
    try:
        return spec.compile()
    except ValueError as error:
        raise FileError(f'MuJoCo cannot use {arm.urdf}: {" ".join(str(error).split())}') from None


def _tip_body(model: mujoco.MjModel, arm: Arm) -> int:
    tip = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, arm.tip_frame)
    if tip < 0:
        raise UnknownNameError(
            'frame', arm.tip_frame, [model.body(b).name for b in range(model.nbody)]
        )
    return tip


def _servo_model(arm: Arm, settings: MujocoSettings) -> mujoco.MjModel:
    """The arm with gravity compensation and three actuators per joint: first all k (q_r - q), then
    all d (dq_r - dq), then all torques that are fed forward.

    ctrl is dq_r for the first two; the position actuators integrate it to q_r, their activation, so
    a cycle is one call into C.
    """
    spec = _load(arm)
    spec.option.timestep = settings.plant_step
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    # Whatever goes wrong, an arm cannot jump to zero.
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    for body in spec.bodies:
        body.gravcomp = 1.0
    # A hard stop: by default a light arm gets degrees past it.
    stop = (4.0 * settings.plant_step, 1.0)
    for joint in spec.joints:
        joint.actgravcomp = True  # counts as the motor's, towards the effort limit
        joint.solref_limit = stop
    for dynamics in (mujoco.mjtDyn.mjDYN_INTEGRATOR, mujoco.mjtDyn.mjDYN_NONE):
        for joint in spec.joints:
            spec.add_actuator(
                target=joint.name,
                trntype=mujoco.mjtTrn.mjTRN_JOINT,
                dyntype=dynamics,
                biastype=mujoco.mjtBias.mjBIAS_AFFINE,
            )
    for joint in spec.joints:
        spec.add_actuator(target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    model = _compile(spec, arm)
    if not settings.joint_friction:
        model.dof_damping[:] = 0.0
        model.dof_frictionloss[:] = 0.0
    _tune(model, settings.servo_bandwidth)
    return model


def _tune(model: mujoco.MjModel, bandwidth: float) -> None:
    n = model.nv
    inertia = _inertia_bound(model)  # (n,)
    stiffness = inertia * bandwidth**2
    damping = 2.0 * inertia * bandwidth
    model.actuator_gainprm[:n, 0] = stiffness
    model.actuator_biasprm[:n, 1] = -stiffness
    model.actuator_gainprm[n : 2 * n, 0] = damping
    model.actuator_biasprm[n : 2 * n, 2] = -damping


def _inertia_bound(model: mujoco.MjModel) -> np.ndarray:
    """D, (n,) [kg m^2]: diag(D) - M(q) is positive semidefinite, being diagonally dominant, at all
    of many random q.
    """
    data = mujoco.MjData(model)
    random = np.random.default_rng(0)
    lower, upper = _joint_range(model, np.pi)
    bound = np.zeros(model.nv)
    for _ in range(SAMPLES):
        data.qpos[:] = random.uniform(lower, upper)
        mujoco.mj_fwdPosition(model, data)
        bound = np.maximum(bound, np.abs(_inertia(model, data)).sum(axis=1))
    return bound


def _joint_range(model: mujoco.MjModel, unlimited: float) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper position limits, both (n,) [rad], with -unlimited and unlimited for joints
    that have none.
    """
    lower, upper = np.where(model.jnt_limited[:, None], model.jnt_range, (-unlimited, unlimited)).T
    return lower, upper


def _inertia(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    return M


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
