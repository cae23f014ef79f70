"""The arms by name, and an arm by a name or a path.

A further arm by name is a URDF, a task in config/tasks and a row here.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from redres_ros.errors import UnknownNameError
from redres_ros.robots.arm import FOLDER, OF_EACH_JOINT, Arm, EndSpeed
from redres_ros.robots.from_urdf import arm_from_urdf


def _radians(*degrees: float) -> tuple[float, ...]:
    """Angles [rad] from degrees."""
    return tuple(np.radians(degrees).tolist())


_LWR4 = Arm(
    urdf=FOLDER / 'lwr4.urdf',
    tip_frame='tool0',
    elbow_frame='link_4',
    # Ia3 to Ia7 as identified by Jubien, Gautier and Janot (2014). Ia1 and Ia2 are their ZZ1 and
    # ZZ2 less the links' share.
    rotor_inertia=(3.19, 3.15, 2.01, 1.92, 0.776, 0.391, 0.399),
    body_radius=(0.08, 0.066, 0.0, 0.064, 0.0, 0.058, 0.0, 0.045),
    # From the controller file of the KRC2.
    acceleration_limit=_radians(1200.0, 1200.0, 1600.0, 1600.0, 2500.0, 4400.0, 4400.0),
    start=_radians(0.0, -30.0, 0.0, 75.0, 0.0, -75.0, 0.0),
    task='lwr4_square',
)

_LWR4_PAPER = replace(  # Section 5
    _LWR4,
    base_offset=0.0125,
    tool_offset=0.135,
    start=_radians(28.08, 104.12, 114.59, 94.85, 14.32, -28.12, 0.0),  # q(0)
    task='rectangle',
)

_IIWA7 = Arm(
    urdf=FOLDER / 'iiwa7.urdf',
    tip_frame='tool0',
    elbow_frame='lbr_link_4',
    body_radius=(0.1, 0.075, 0.075, 0.07, 0.07, 0.065, 0.06, 0.04),
    # KUKA publishes none. An assumption: what the MoveIt configuration of lbr_fri_ros2_stack sets.
    acceleration_limit=(10.0,) * 7,
    start=_radians(0.0, 30.0, 0.0, -75.0, 0.0, 75.0, 0.0),
    task='iiwa7_square',
)

_FR3 = Arm(
    urdf=FOLDER / 'fr3.urdf',
    tip_frame='tool0',
    elbow_frame='fr3_link4',
    body_radius=(0.09, 0.0, 0.06, 0.055, 0.055, 0.0, 0.05, 0.045),
    # The joint limits of FR3 in Franka's documentation of its interface; libfranka's rate limiter
    # has the same. The robot ends a motion beyond them.
    acceleration_limit=(10.0,) * 7,
    jerk_limit=(5000.0,) * 7,
    # Position-based velocity limits, of the same page and computeUpperLimitsJointVelocity().
    end_speeds=(
        EndSpeed(-2.7501, 2.7501, 6.0, 0.30),
        EndSpeed(-1.7918, 1.7918, 2.585, 0.20),
        EndSpeed(-2.9065, 2.9065, 3.5, 0.20),
        EndSpeed(-3.0481, -0.1458, 4.0, 0.30),
        EndSpeed(-2.8101, 2.8101, 17.0, 0.35),
        EndSpeed(0.54092, 4.5205, 5.5, 0.35),
        EndSpeed(-3.0196, 3.0196, 17.0, 0.35),
    ),
    start=_radians(0.0, -45.0, 0.0, -135.0, 0.0, 90.0, 45.0),
    task='fr3_square',
)

_GEN3 = Arm(
    urdf=FOLDER / 'gen3.urdf',
    tip_frame='tool0',
    elbow_frame='forearm_link',
    body_radius=(0.08, 0.046, 0.046, 0.046, 0.044, 0.038, 0.038, 0.036),
    # Kinova's user guide: 297.94 deg/s^2 for the large actuators, 572.95 deg/s^2 for the small.
    acceleration_limit=(5.2, 5.2, 5.2, 5.2, 10.0, 10.0, 10.0),
    # Kinova's home, but with joint 3 away from 180 degrees, where its driver jumps by a turn.
    start=_radians(0.0, 15.0, 0.0, 130.0, 0.0, -55.0, -90.0),
    task='gen3_square',
)

_PLANAR4R = Arm(
    urdf=FOLDER / 'planar4r.urdf',
    tip_frame='tool0',
    elbow_frame='link_3',
    body_radius=(0.0, 0.04, 0.04, 0.04, 0.03),
    acceleration_limit=(2.0, 2.0, 4.0, 4.0),  # as of the planar example named in the URDF
    start=_radians(0.0, 90.0, -90.0, 90.0),
    task='planar4r_hexagon',
)

ARMS: dict[str, Arm] = {
    'lwr4': _LWR4,  # the bare arm
    'lwr4_paper': _LWR4_PAPER,
    'iiwa7': _IIWA7,
    'fr3': _FR3,
    'gen3': _GEN3,
    'planar4r': _PLANAR4R,
}


def find_arm(name: str, **changes: object) -> Arm:
    """The arm of that name, with fields set to other values.

    With another tip than in the table it has no default task, and joints beyond the tip are held
    still. Raises UnknownNameError, and RangeError for an offset beyond 2 m.
    """
    if name not in ARMS:
        raise UnknownNameError('robot', name, ARMS)
    arm = ARMS[name]
    changed = replace(arm, **changes)  # type: ignore[arg-type]  # as many types as fields
    if changed.tip_frame == arm.tip_frame:
        return changed
    bare = replace(changed, **dict.fromkeys(OF_EACH_JOINT, ()))  # type: ignore[arg-type]
    n = bare.kinematics().n
    figures = {field: getattr(changed, field)[:n] for field in OF_EACH_JOINT}
    return replace(changed, task='', body_radius=changed.body_radius[: n + 1], **figures)


def choose_arm(
    robot: str, tip_frame: str = '', elbow_frame: str = '', others: tuple[str, ...] = ()
) -> Arm:
    """The arm of a name or a .urdf file; what is empty is its own, or as `arm_from_urdf` chooses.

    Raises UnknownNameError, which lists `others` that the caller takes, too, and FileError.
    """
    if robot in ARMS:
        given = {'tip_frame': tip_frame, 'elbow_frame': elbow_frame}
        return find_arm(robot, **{name: value for name, value in given.items() if value})
    if Path(robot).suffix not in ('.urdf', '.xacro'):  # which is refused with a remedy
        raise UnknownNameError('robot', robot, (*ARMS, 'a path ending in .urdf', *others))
    return arm_from_urdf(Path(robot), tip_frame, elbow_frame)
