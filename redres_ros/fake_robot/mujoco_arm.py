"""An arm as a model of MuJoCo with position servos; a table or a wall that its tip can touch."""

from dataclasses import dataclass

import mujoco
import numpy as np

from redres_ros.errors import ArrayError, FileError, UnknownNameError, reason_of
from redres_ros.parameter import Checked, param
from redres_ros.robots import Arm

PLANT_STEP = 0.0005  # [s] of the simulation; the cycle is a whole multiple of it
_SAMPLES = 200  # random positions from which the largest inertia is estimated

_TIP_RADIUS = 0.005  # [m] of the sphere at the tip, which alone touches anything
_SURFACE = 'surface'
_HALF_WIDTH = 0.5  # [m] of the surfaces that pictures show; the tip touches them everywhere
_FRICTION = 0.3  # coefficient
# A soft contact of MuJoCo acts like a spring beside an inertia, which is this fraction of the
# tip's own, or less: the least that there is. An admittance feels it like a mass on the sensor.
_IMPEDANCE = 0.0001
_RELAXATION = 0.001  # [s] damping of the contact in relation to its stiffness
_FRICTION_RATIO = 100.0  # friction is so much stiffer than the contact: the tip does not creep


@dataclass(frozen=True)
class EnvironmentSettings(Checked):
    """What the tip can touch. Raises RangeError, UnknownNameError or ArrayError."""

    contact_shape: str = param(
        'none',
        'what the tip can touch: a table, or a wall that faces the base',
        choices=('none', 'table', 'wall'),
    )
    contact_position: tuple[float, ...] = param(
        (0.5, 0.0, 0.0), 'the tip where it touches, in the base frame [m]', -10.0, 10.0
    )
    contact_stiffness: float = 1e4  # [N/m]
    contact_friction: float = _FRICTION

    def __post_init__(self) -> None:
        super().__post_init__()
        size = len(self.contact_position)
        if size != 3:
            raise ArrayError(f'contact_position holds {size} numbers; expected 3')
        if self.contact_shape == 'wall' and not any(self.contact_position[:2]):
            raise ArrayError('contact_position of a wall is above the base; expected beside it')


def servo_model(
    arm: Arm, environment: EnvironmentSettings, servo_bandwidth: float
) -> mujoco.MjModel:
    """The arm with gravity compensation and three actuators per joint: first all k (q_r - q), then
    all d (dq_r - dq), then all torques that are fed forward. With k = D w^2 and d = 2 D w, where w
    is the bandwidth of the servos [rad/s] and D bounds the inertia matrix, no mode is underdamped.

    ctrl is dq_r for the first two; the position actuators integrate it to q_r, their activation, so
    a cycle is one call into C. Raises FileError for a URDF that MuJoCo cannot use, UnknownNameError
    for one without the tip.
    """
    spec = load(arm)
    if spec.body(arm.tip_frame) is None:
        raise UnknownNameError('frame', arm.tip_frame, [body.name for body in spec.bodies])
    spec.option.timestep = PLANT_STEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    # Whatever goes wrong, an arm cannot jump to zero.
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    for body in spec.bodies:
        body.gravcomp = 1.0
    for joint in spec.joints:
        joint.actgravcomp = True  # counts as the motor's, towards the effort limit
        joint.solref_limit = (4.0 * PLANT_STEP, 1.0)  # by default a light arm gets degrees past it
    none = mujoco.mjtDyn.mjDYN_NONE
    for dynamics in (mujoco.mjtDyn.mjDYN_INTEGRATOR, none, none):
        for joint in spec.joints:
            spec.add_actuator(
                target=joint.name,
                trntype=mujoco.mjtTrn.mjTRN_JOINT,
                dyntype=dynamics,
                biastype=mujoco.mjtBias.mjBIAS_AFFINE,  # none for the torques
            )
    if environment.contact_shape == 'none':
        model = compiled(spec, arm)
    else:
        model = _with_surface(spec, arm, environment)
    model.dof_frictionloss[:] = 0.0
    n = model.nv
    bound = _inertia_bound(model)  # (n,)
    stiffness = bound * servo_bandwidth**2
    damping = 2.0 * bound * servo_bandwidth
    model.actuator_gainprm[:n, 0] = stiffness
    model.actuator_biasprm[:n, 1] = -stiffness
    model.actuator_gainprm[n : 2 * n, 0] = damping
    model.actuator_biasprm[n : 2 * n, 2] = -damping
    return model


def load(arm: Arm) -> mujoco.MjSpec:
    """Bodies and joints, without shapes. Raises FileError for a URDF that MuJoCo cannot read."""
    try:
        spec = mujoco.MjSpec.from_string(arm.description())
    except ValueError as error:
        raise FileError(f'MuJoCo cannot read {arm.source}: {error}') from None
    for shape in (*spec.geoms, *spec.meshes):
        spec.delete(shape)
    compiler = spec.compiler
    compiler.fusestatic = False
    compiler.balanceinertia = True  # moments that no body can have become their mean
    compiler.boundmass = 0.0
    compiler.boundinertia = 0.0
    if arm.armature:
        for joint, armature in zip(spec.joints, arm.armature, strict=True):
            joint.armature = armature
    return spec


def compiled(spec: mujoco.MjSpec, arm: Arm) -> mujoco.MjModel:
    """What MuJoCo simulates. Raises FileError, which names the arm's URDF, if it cannot."""
    try:
        return spec.compile()
    except ValueError as error:
        raise FileError(f'MuJoCo cannot use {arm.source}: {reason_of(error)}') from None


def _with_surface(spec: mujoco.MjSpec, arm: Arm, settings: EnvironmentSettings) -> mujoco.MjModel:
    """What MuJoCo simulates, with a surface and a sphere at the tip.

    At rest the force of a contact with the constant impedance d and the reference -k is
    k / ((1 - d) w) times the depth, where w is the inverse inertia of the tip: MuJoCo's figures for
    a stiffness in N/m depend on the arm.
    """
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = _FRICTION_RATIO
    tip = spec.body(arm.tip_frame)
    sphere = tip.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(_TIP_RADIUS, 0, 0))
    surface = spec.worldbody.add_geom(
        name=_SURFACE, type=mujoco.mjtGeom.mjGEOM_PLANE, size=(_HALF_WIDTH, _HALF_WIDTH, 0.01)
    )
    surface.pos = np.array(settings.contact_position) - _TIP_RADIUS * _normal(settings)
    surface.alt.type = mujoco.mjtOrientation.mjORIENTATION_ZAXIS
    surface.alt.zaxis = _normal(settings)
    for geom in (sphere, surface):
        geom.mass = 0.0
    surface.priority = 1  # its figures count, not a mixture
    surface.friction = (settings.contact_friction, 0.0, 0.0)
    surface.solimp = (_IMPEDANCE, _IMPEDANCE, 0.001, 0.5, 2.0)
    model = compiled(spec, arm)
    inverse_inertia = model.body(arm.tip_frame).invweight0[0]
    reference = settings.contact_stiffness * (1.0 - _IMPEDANCE) * inverse_inertia
    model.geom(_SURFACE).solref[:] = (-reference, -reference * _RELAXATION)
    return model


def _normal(settings: EnvironmentSettings) -> np.ndarray:
    """Direction out of the table or wall in the base frame, (3,)."""
    if settings.contact_shape == 'table':
        return np.array((0.0, 0.0, 1.0))
    x, y, _ = settings.contact_position
    return np.array((-x, -y, 0.0)) / np.hypot(x, y)


def _inertia_bound(model: mujoco.MjModel) -> np.ndarray:
    """D, (n,) [kg m^2]: diag(D) - M(q) is diagonally dominant, so >= 0, at many random q."""
    data = mujoco.MjData(model)
    random = np.random.default_rng(0)
    limits = np.where(model.jnt_limited[:, None], model.jnt_range, (-np.pi, np.pi)).T
    bound = np.zeros(model.nv)
    M = np.empty((model.nv, model.nv))
    for _ in range(_SAMPLES):
        data.qpos[:] = random.uniform(*limits)
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fullM(model, data, M)
        bound = np.maximum(bound, np.abs(M).sum(axis=1))
    return bound
