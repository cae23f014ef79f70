"""The arms by name. A further arm is a URDF, a task in config/tasks and a row here."""

from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np

from redres_ros.errors import UnknownNameError
from redres_ros.robots.arm import Arm


def _urdf(name: str) -> Path:
    return Path(str(resources.files(__package__) / f'{name}.urdf'))


def _radians(*degrees: float) -> tuple[float, ...]:
    return tuple(np.radians(degrees).tolist())


_LWR4 = Arm(
    urdf=_urdf('lwr4'),
    tip_frame='tool0',
    elbow_frame='link_4',
    # Ia3 to Ia7 as identified by Jubien, Gautier and Janot (2014). Ia1 and Ia2 are their ZZ1 and
    # ZZ2 less the links' share.
    rotor_inertia=(3.19, 3.15, 2.01, 1.92, 0.776, 0.391, 0.399),
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
    urdf=_urdf('iiwa7'),
    tip_frame='tool0',
    elbow_frame='lbr_link_4',
    # KUKA publishes none. An assumption: what the MoveIt configuration of lbr_fri_ros2_stack sets.
    acceleration_limit=(10.0,) * 7,
    start=_radians(0.0, 30.0, 0.0, -75.0, 0.0, 75.0, 0.0),
    task='iiwa7_square',
)

_FR3 = Arm(
    urdf=_urdf('fr3'),
    tip_frame='tool0',
    elbow_frame='fr3_link4',
    # Franka Robotics' interface specification; libfranka refuses commands beyond it.
    acceleration_limit=(10.0,) * 7,
    start=_radians(0.0, -45.0, 0.0, -135.0, 0.0, 90.0, 45.0),
    task='fr3_square',
)

_GEN3 = Arm(
    urdf=_urdf('gen3'),
    tip_frame='tool0',
    elbow_frame='forearm_link',
    # Kinova's user guide: 297.94 deg/s^2 for the large actuators, 572.95 deg/s^2 for the small.
    acceleration_limit=(5.2, 5.2, 5.2, 5.2, 10.0, 10.0, 10.0),
    start=_radians(0.0, 15.0, 180.0, -130.0, 0.0, 55.0, 90.0),
    task='gen3_square',
)

_PLANAR4R = Arm(
    urdf=_urdf('planar4r'),
    tip_frame='tool0',
    elbow_frame='link_3',
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
    """The arm of that name.

    Args:
        name: In the table ARMS.
        changes: Fields of the arm to set to another value; None leaves a field as it is.

    Raises:
        UnknownNameError: No such arm, or no such dynamics.
        RangeError: An offset beyond 2 m.
    """
    if name not in ARMS:
        raise UnknownNameError('robot', name, ARMS)
    given = {field: value for field, value in changes.items() if value is not None}
    return replace(ARMS[name], **given)  # type: ignore[arg-type]  # as many types as fields
