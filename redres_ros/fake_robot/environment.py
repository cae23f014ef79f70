"""What the tip of the simulated arm can touch: a table, a wall or a ball."""

from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np

from redres_ros.errors import ArrayError
from redres_ros.parameter import check_parameters, param

NOTHING = 'none'
SHAPES = (NOTHING, 'table', 'wall', 'ball')

_TIP_RADIUS = 0.005  # [m] of the sphere at the tip, which alone touches anything
# A soft contact of MuJoCo acts like a spring beside an inertia, which is this fraction of the
# tip's own, or less: the least that there is. An admittance feels it like a mass on the sensor.
_IMPEDANCE = 0.0001
_RELAXATION = 0.001  # [s] damping of the contact in relation to its stiffness
_FRICTION_RATIO = 100.0  # friction is so much stiffer than the contact: the tip does not creep
_HALF_WIDTH = 0.5  # [m] of the surfaces that pictures show; the tip touches them everywhere


@dataclass(frozen=True)
class EnvironmentSettings:
    """What the tip can touch. Raises RangeError, UnknownNameError or ArrayError."""

    contact_shape: str = param(
        NOTHING,
        'what the tip can touch: a table (normal z), a wall (any normal), a ball',
        choices=SHAPES,
    )
    contact_position: tuple[float, ...] = param(
        (0.0, 0.0, 0.0),
        'the tip where it touches the table or wall, or the centre of the ball, in the base frame '
        '[m]',
        -10.0,
        10.0,
    )
    contact_normal: tuple[float, ...] = param(
        (-1.0, 0.0, 0.0), 'direction out of the wall, in the base frame [1]', -1.0, 1.0
    )
    contact_radius: float = param(0.1, 'of the ball [m]', 0.01, 1.0)
    contact_stiffness: float = param(1e4, 'of the contact [N/m]', 100.0, 1e6)
    contact_friction: float = param(0.3, 'coefficient of friction [-]', 0.0, 2.0)

    def __post_init__(self) -> None:
        check_parameters(self)
        for name in ('contact_position', 'contact_normal'):
            value = getattr(self, name)
            if len(value) != 3:
                raise ArrayError(f'{name} holds {len(value)} numbers; expected 3')
        if not any(self.contact_normal):
            raise ArrayError('contact_normal is zero; expected a direction')

    @property
    def normal(self) -> np.ndarray:
        """Direction out of the table or wall, (3,) [1]."""
        if self.contact_shape == 'table':
            return np.array((0.0, 0.0, 1.0))
        direction = np.array(self.contact_normal)
        return direction / np.linalg.norm(direction)


class ContactForce(NamedTuple):
    """The force of one contact on the tip: its point (3,) [m], and itself (3,) [N]; both in the
    base frame.
    """

    point: np.ndarray
    force: np.ndarray


def add_environment(spec: mujoco.MjSpec, tip: str, settings: EnvironmentSettings) -> None:
    """Add the surface and the tip's sphere to a model.

    Args:
        spec: Specification of the arm, which is changed.
        tip: Name of the link that touches.
        settings: What it touches.
    """
    if settings.contact_shape == NOTHING:
        return
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = _FRICTION_RATIO
    sphere = spec.body(tip).add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(_TIP_RADIUS, 0, 0))
    surface = spec.worldbody.add_geom(name=NOTHING)
    position = np.array(settings.contact_position)
    if settings.contact_shape == 'ball':
        surface.type = mujoco.mjtGeom.mjGEOM_SPHERE
        surface.size = (settings.contact_radius, 0, 0)
        surface.pos = position
    else:
        surface.type = mujoco.mjtGeom.mjGEOM_PLANE
        surface.size = (_HALF_WIDTH, _HALF_WIDTH, 0.01)
        surface.pos = position - _TIP_RADIUS * settings.normal
        surface.alt.type = mujoco.mjtOrientation.mjORIENTATION_ZAXIS
        surface.alt.zaxis = settings.normal
    for geom in (sphere, surface):
        geom.mass = 0.0
        geom.contype = 1
        geom.conaffinity = 1
        geom.condim = 3
    surface.priority = 1  # its figures count, not a mixture
    surface.friction = (settings.contact_friction, 0.0, 0.0)


def set_stiffness(model: mujoco.MjModel, tip: str, settings: EnvironmentSettings) -> None:
    """Give the contact its stiffness in N/m, of which MuJoCo's figures depend on the arm.

    At rest the force of a contact with the constant impedance d and the reference -k is
    k / ((1 - d) w) times the depth, where w is the inverse inertia of the tip.

    Args:
        model: With the surface; changed.
        tip: Name of the link that touches.
        settings: What it touches.
    """
    if settings.contact_shape == NOTHING:
        return
    surface = model.geom(NOTHING)
    inverse_inertia = model.body(tip).invweight0[0]
    reference = settings.contact_stiffness * (1.0 - _IMPEDANCE) * inverse_inertia
    surface.solref[:] = (-reference, -reference * _RELAXATION)
    surface.solimp[:] = (_IMPEDANCE, _IMPEDANCE, 0.001, 0.5, 2.0)


def contact_forces(model: mujoco.MjModel, data: mujoco.MjData, tip: int) -> list[ContactForce]:
    """The forces on the tip from what it touches.

    Args:
        model: Model of arm and surface.
        data: Its state after a step.
        tip: Number of the body that touches.
    """
    forces = []
    in_its_frame = np.zeros(6)
    for number in range(data.ncon):
        contact = data.contact[number]
        mujoco.mj_contactForce(model, data, number, in_its_frame)
        force = contact.frame.reshape(3, 3).T @ in_its_frame[:3]  # on the second shape
        sign = 1.0 if model.geom_bodyid[contact.geom[1]] == tip else -1.0
        forces.append(ContactForce(contact.pos.copy(), sign * force))
    return forces
