"""An arm: its URDF with tool, base offset and choice of dynamics filled in, and figures a URDF has
no place for.
"""

import xml.etree.ElementTree as ET
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path

import numpy as np

from redres_ros.errors import FileError, RangeError, UnknownNameError

DYNAMICS = ('lwr', 'cylinders')

CYLINDER_MASS = 1.0
CYLINDER_RADIUS = 0.06
CYLINDER_MIN_LENGTH = 0.001  # [kg], [m], [m]


@dataclass(frozen=True)
class Arm:
    """An arm as data. `description()` is the one URDF that Pinocchio, MuJoCo and RViz read alike.

    base_offset [m] raises base_link above the URDF's root link; tool_offset [m] is the way from the
    flange to the tip along the flange's z. dynamics: 'lwr', the URDF's own inertias with rotors and
    friction; 'cylinders', the paper's Section 5.2 with each link a body of 1 kg, here a solid
    cylinder because an ideal rod makes M singular.
    """

    urdf: Path
    tip_frame: str
    elbow_frame: str = ''
    base_offset: float = 0.0
    tool_offset: float = 0.0
    dynamics: str = 'lwr'
    rotor_inertia: tuple[float, ...] = ()  # (n,) [kg m^2], reflected to the joints; empty: none
    acceleration_limit: tuple[float, ...] = ()  # (n,) [rad/s^2]; empty: unlimited

    def __post_init__(self) -> None:
        if self.dynamics not in DYNAMICS:
            raise UnknownNameError('dynamics', self.dynamics, DYNAMICS)
        for name in ('base_offset', 'tool_offset'):
            if not -2.0 <= getattr(self, name) <= 2.0:
                raise RangeError(name, getattr(self, name), -2.0, 2.0, 'm')

    @property
    def armature(self) -> tuple[float, ...]:
        """Rotor inertias that belong to the chosen dynamics, (n,) [kg m^2]; empty: none."""
        return self.rotor_inertia if self.dynamics == 'lwr' else ()

    def description(self) -> str:
        """The URDF's text with offsets and dynamics filled in: what ROS calls robot_description.

        Raises FileError when the file cannot be read, is no URDF, or lacks a joint that an offset
        needs.
        """
        try:
            robot = ET.fromstring(self.urdf.read_text(encoding='utf-8'))
        except OSError as error:
            raise FileError(f'cannot read the URDF {self.urdf}: {error.strerror}') from None
        except (ET.ParseError, UnicodeDecodeError) as error:
            raise FileError(f'{self.urdf} is no URDF: {error}') from None
        for joint, offset in (('base_mount', self.base_offset), ('tool_mount', self.tool_offset)):
            if offset:
                _mount(robot, joint, self.urdf).set('xyz', f'0 0 {offset!r}')
        if self.dynamics == 'cylinders':
            _make_cylinders(robot)
        return ET.tostring(robot, encoding='unicode')


def _mount(robot: ET.Element, joint: str, urdf: Path) -> ET.Element:
    origin = robot.find(f"joint[@name='{joint}']/origin")
    if origin is None:
        raise FileError(f'{urdf} has no fixed joint {joint} with an origin, which an offset needs')
    return origin


def _make_cylinders(robot: ET.Element) -> None:
    """Replace each moving link's inertia by a cylinder from its joint along z to the next joint, or
    to the tip.
    """
    for joint in robot.findall("joint[@type='revolute']"):
        link = joint.find('child').get('link')
        offset = _length_along_z(robot, link)
        length = max(offset, CYLINDER_MIN_LENGTH)
        inertial = robot.find(f"link[@name='{link}']/inertial")
        inertial.find('origin').set('xyz', f'0 0 {offset / 2!r}')
        inertial.find('mass').set('value', repr(CYLINDER_MASS))
        across = CYLINDER_MASS * (3 * CYLINDER_RADIUS**2 + length**2) / 12
        along = CYLINDER_MASS * CYLINDER_RADIUS**2 / 2
        inertial.find('inertia').attrib.update(ixx=repr(across), iyy=repr(across), izz=repr(along))
        for dynamics in joint.findall('dynamics'):
            joint.remove(dynamics)


def _length_along_z(robot: ET.Element, link: str) -> float:
    """Distance from a link's frame along z, through fixed joints, to the next moving joint or the
    chain's end [m].
    """
    for joint in robot.findall('joint'):
        if joint.find('parent').get('link') == link:
            z = float(joint.find('origin').get('xyz').split()[2])
            is_fixed = joint.get('type') == 'fixed'
            return z + (
                _length_along_z(robot, joint.find('child').get('link')) if is_fixed else 0.0
            )
    return 0.0


_LWR4 = Arm(
    urdf=Path(str(resources.files(__package__) / 'lwr4.urdf')),
    tip_frame='tool0',
    elbow_frame='link_4',
    # Ia3..Ia7 as identified by Jubien, Gautier and Janot (2014); Ia1 and Ia2 are their ZZ1 and ZZ2
    # less the links'
    # share.
    rotor_inertia=(3.19, 3.15, 2.01, 1.92, 0.776, 0.391, 0.399),
    # From the KRC2 file.
    acceleration_limit=tuple(
        np.radians((1200.0, 1200.0, 1600.0, 1600.0, 2500.0, 4400.0, 4400.0)).tolist()
    ),
)

ARMS: dict[str, Arm] = {
    'lwr4': _LWR4,  # the bare arm
    'lwr4_paper': replace(
        _LWR4, base_offset=0.0125, tool_offset=0.135, dynamics='cylinders'
    ),  # Section 5
}


def find_arm(name: str, **changes: object) -> Arm:
    """The arm of that name, with the given fields changed unless None. Raises UnknownNameError,
    RangeError.
    """
    if name not in ARMS:
        raise UnknownNameError('robot', name, ARMS)
    return replace(
        ARMS[name], **{field: value for field, value in changes.items() if value is not None}
    )
