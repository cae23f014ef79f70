"""An arm as a model of MuJoCo: its bodies exactly as the URDF has them, and position servos."""

from dataclasses import dataclass

import mujoco
import numpy as np

from redres_ros.errors import FileError, RangeError, UnknownNameError, reason_of
from redres_ros.fake_robot.environment import EnvironmentSettings, add_environment, set_stiffness
from redres_ros.parameter import check_parameters, param
from redres_ros.robots import Arm

SERVO_GROUP = 1  # of the actuators that act on position and velocity
_SAMPLES = 200  # random positions from which the largest inertia is estimated


@dataclass(frozen=True)
class MujocoSettings:
    """The simulated arm below the level of the reference. Raises RangeError for a wrong figure."""

    plant_step: float = param(
        0.0005, 'simulation step; the cycle must be a whole multiple of it [s]', 1e-5, 0.01
    )
    servo_bandwidth: float = param(
        100.0, 'natural frequency of the position servos [rad/s]', 1.0, 1000.0
    )
    joint_friction: bool = param(
        False, 'let joint friction act on the servos, as if no joint torque loop compensated it'
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


def servo_model(
    arm: Arm, settings: MujocoSettings, environment: EnvironmentSettings
) -> mujoco.MjModel:
    """The arm with gravity compensation and three actuators per joint: first all k (q_r - q), then
    all d (dq_r - dq), then all torques that are fed forward.

    ctrl is dq_r for the first two; the position actuators integrate it to q_r, their activation, so
    a cycle is one call into C.

    Args:
        arm: Whose description is simulated.
        settings: Settings of the simulation and the servos.
        environment: What the tip can touch.

    Raises:
        FileError: MuJoCo cannot use the URDF.
        UnknownNameError: The URDF lacks the tip frame.
    """
    spec = load(arm)
    if spec.body(arm.tip_frame) is None:
        raise UnknownNameError('frame', arm.tip_frame, [body.name for body in spec.bodies])
    _set_physics(spec, settings)
    _add_actuators(spec)
    add_environment(spec, arm.tip_frame, environment)
    model = compiled(spec, arm)
    set_stiffness(model, arm.tip_frame, environment)
    if not settings.joint_friction:
        model.dof_damping[:] = 0.0
        model.dof_frictionloss[:] = 0.0
    _tune(model, settings.servo_bandwidth)
    return model


def load(arm: Arm) -> mujoco.MjSpec:
    """The arm's bodies and joints, inertias exactly as given; shapes are dropped, as links touch
    nothing here. Raises FileError for a URDF that MuJoCo cannot read.
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


def compiled(spec: mujoco.MjSpec, arm: Arm) -> mujoco.MjModel:
    """What MuJoCo simulates.

    Args:
        spec: The arm's bodies, joints and actuators.
        arm: Whose URDF an error names.

    Raises:
        FileError: MuJoCo cannot use it.
    """
    try:
        return spec.compile()
    except ValueError as error:
        raise FileError(f'MuJoCo cannot use {arm.urdf}: {reason_of(error)}') from None


def joint_range(model: mujoco.MjModel, unlimited: float) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper position limits, both (n,) [rad].

    Args:
        model: Model of the arm.
        unlimited: A joint without limits has -unlimited and unlimited [rad].
    """
    lower, upper = np.where(model.jnt_limited[:, None], model.jnt_range, (-unlimited, unlimited)).T
    return lower, upper


def inertia(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """M(q), (n, n) [kg m^2], with rotors.

    Args:
        model: Model of the arm.
        data: Its state, after mj_fwdPosition.
    """
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    return M


def _set_physics(spec: mujoco.MjSpec, settings: MujocoSettings) -> None:
    """Time step, gravity compensation, and the ends of the joints' ranges."""
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


def _add_actuators(spec: mujoco.MjSpec) -> None:
    """Stiffness of every joint, then damping of every joint, then torque of every joint."""
    for dynamics in (mujoco.mjtDyn.mjDYN_INTEGRATOR, mujoco.mjtDyn.mjDYN_NONE):
        for joint in spec.joints:
            spec.add_actuator(
                target=joint.name,
                trntype=mujoco.mjtTrn.mjTRN_JOINT,
                dyntype=dynamics,
                biastype=mujoco.mjtBias.mjBIAS_AFFINE,
                group=SERVO_GROUP,
            )
    for joint in spec.joints:
        spec.add_actuator(target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)


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
    lower, upper = joint_range(model, np.pi)
    bound = np.zeros(model.nv)
    for _ in range(_SAMPLES):
        data.qpos[:] = random.uniform(lower, upper)
        mujoco.mj_fwdPosition(model, data)
        bound = np.maximum(bound, np.abs(inertia(model, data)).sum(axis=1))
    return bound
