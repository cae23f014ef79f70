"""A URDF made ready for Pinocchio, MuJoCo and RViz alike: the joints that move, and inertias."""

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

from redres_ros.errors import FileError, UnknownNameError
from redres_ros.files.installation import remedy

if not hasattr(pin.Model, 'armature'):  # 2.7, which pip chooses if asked for numpy 1.26, too
    raise ImportError(
        f'got Pinocchio {pin.__version__} in {pin.__file__}; allowed: 3.3.1 or newer; '
        f'remove it, then: {remedy("pinocchio")}'
    )

TEXT = 'the robot description'  # name in errors of a URDF that is no file
CONTINUOUS_RANGE = 2000.0 * math.pi  # [rad] to either side, for a joint that turns without end
UNLIMITED_EFFORT = 1e9  # [N m] or [N], for a joint whose URDF gives none

_LARGEST = 1e50  # number, whose square is finite as well
_MOST_JOINTS = 100  # from the root link to a tip; memory grows by the cube of their number
_MOVING = ('revolute', 'continuous', 'prismatic')
_OF_MOVING_JOINTS = ('axis', 'limit', 'dynamics', 'mimic', 'safety_controller', 'calibration')

_CYLINDER_MASS = 1.0  # [kg]
_CYLINDER_RADIUS = 0.06  # [m]
_CYLINDER_MIN_LENGTH = 0.001  # [m]


@dataclass(frozen=True)
class _Joint:
    """A joint's element, its name, and the links that it connects."""

    element: ET.Element
    name: str
    parent: str
    child: str

    @property
    def type(self) -> str:
        """The type as it is now; empty without one."""
        return self.element.get('type', '')


@dataclass(frozen=True)
class Urdf:
    """A URDF, whose elements may be changed; `source` names it in errors."""

    robot: ET.Element
    source: str

    @classmethod
    def parsed(cls, text: str, source: str = TEXT) -> 'Urdf':
        """A URDF from its text. Raises FileError."""
        try:
            robot = ET.fromstring(text)
        except (ET.ParseError, ValueError) as error:
            raise FileError(f'{source} is not a URDF:  {error}') from None
        if robot.tag != 'robot' or not robot.findall('link'):
            raise FileError(f'{source} is not a URDF:  expected a robot with at least one link')
        if any('/xacro}' in element.tag for element in robot.iter()):
            raise FileError(f'{source} holds xacro; write the URDF first: xacro FILE > arm.urdf')
        return cls(robot, source)

    def text(self) -> str:
        """The URDF as it is now. Raises FileError."""
        try:
            return ET.tostring(self.robot, encoding='unicode')
        except RecursionError:
            raise self.error('its elements are nested too deeply') from None

    def error(self, problem: str) -> FileError:
        """An error to raise, which names this URDF."""
        return FileError(f'{self.source}: {problem}')

    @cached_property
    def links(self) -> dict[str, ET.Element]:
        """The links by name."""
        return {link.get('name', ''): link for link in self.robot.findall('link')}

    def check_link(self, name: str) -> None:
        """Raise UnknownNameError unless a link has that name."""
        if name not in self.links:
            raise UnknownNameError('frame', name, self.links)

    @cached_property
    def joints(self) -> tuple[_Joint, ...]:
        """The joints as they are listed. Raises FileError for one without links or a name twice."""
        joints = tuple(self._joint(element) for element in self.robot.findall('joint'))
        names = [joint.name for joint in joints]
        for name in names:
            if names.count(name) > 1:
                raise self.error(f'there are {names.count(name)} joints {name!r}; expected one')
        return joints

    def _joint(self, element: ET.Element) -> _Joint:
        name = element.get('name', '')
        ends = []
        for end in ('parent', 'child'):
            found = element.find(end)
            link = '' if found is None else found.get('link', '')
            if link not in self.links:
                raise self.error(f'the {end} link {link!r} of joint {name!r} does not exist')
            ends.append(link)
        return _Joint(element, name, *ends)

    def _numbers(
        self, element: ET.Element | None, attribute: str, default: str, owner: str
    ) -> np.ndarray:
        """As many numbers as the default, of an element that may be missing. Raises FileError."""
        text = default if element is None else element.get(attribute, default)
        expected = len(default.split())
        try:
            values = [float(word) for word in text.split()]
        except ValueError:
            values = []
        if len(values) != expected or not all(abs(value) <= _LARGEST for value in values):
            noun = 'a number' if expected == 1 else f'{expected} numbers'
            raise self.error(
                f'{owner} has {attribute} {text!r}; expected {noun} up to {_LARGEST:g}'
            )
        return np.array(values)

    def _number(self, element: ET.Element | None, attribute: str, owner: str) -> float:
        """An attribute's number, 0 if it is missing. Raises FileError."""
        return float(self._numbers(element, attribute, '0', owner)[0])


def child(element: ET.Element, tag: str) -> ET.Element:
    """The element's first child of that tag, made if there is none."""
    found = element.find(tag)
    return ET.SubElement(element, tag) if found is None else found


def tree_to(urdf: Urdf, tip_frames: Sequence[str]) -> tuple[_Joint, ...]:
    """The joints that lead to any of the tips, fixed ones included, in Pinocchio's order: each
    after those before it, and branches by the names of their joints. Raises UnknownNameError for a
    tip that is no link, and FileError for links that are no tree.
    """
    leading = {}  # by the names of all joints up to each
    for tip_frame in tip_frames:
        chain = _chain_to(urdf, tip_frame)
        names = tuple(joint.name for joint in chain)
        for number, joint in enumerate(chain, 1):
            leading[names[:number]] = joint
    return tuple(leading[names] for names in sorted(leading))


def _chain_to(urdf: Urdf, tip_frame: str) -> tuple[_Joint, ...]:
    """The joints from the root link to a tip, fixed ones included."""
    urdf.check_link(tip_frame)
    above: dict[str, _Joint] = {}
    for joint in urdf.joints:
        other = above.setdefault(joint.child, joint)
        if other is not joint:
            raise urdf.error(
                f'link {joint.child} has two parent joints, {other.name}, {joint.name}'
            )
    chain: list[_Joint] = []
    link = tip_frame
    while link in above:
        joint = above[link]
        if joint in chain:
            raise urdf.error(f'joint {joint.name} is part of a circle; expected a tree of links')
        if len(chain) == _MOST_JOINTS:
            raise urdf.error(f'more joints than {_MOST_JOINTS} lead to {tip_frame}')
        chain.append(joint)
        link = joint.parent
    for other_root in urdf.links.keys() - above.keys() - {link}:
        raise urdf.error(
            f'links {link} and {other_root} have no parent joint; expected one root link'
        )
    return tuple(reversed(chain))


def write_out_joints(urdf: Urdf, tree: tuple[_Joint, ...]) -> list[str]:
    """Check joints and inertias, and write out what Pinocchio and MuJoCo would read differently;
    hold all other joints at zero. Returns a sentence for each assumption.

    A joint that turns without end becomes a revolute one with a range that no arm uses up, as the
    libraries have positions of other kinds for it. Raises FileError for what cannot be used.
    """
    for joint in tree:
        if joint.type not in (*_MOVING, 'fixed'):
            raise urdf.error(
                f'joint {joint.name} is {joint.type or "without a type"}; from the root link to '
                f'the tip joints may be {", ".join(_MOVING)} or fixed'
            )
        origin = joint.element.find('origin')
        for attribute in ('xyz', 'rpy'):
            urdf._numbers(origin, attribute, '0 0 0', f'joint {joint.name}')
    moving = [joint for joint in tree if joint.type != 'fixed']
    if not moving:
        raise urdf.error('no joint moves the tip; expected at least one from the root link to it')
    remarks = []
    for joint in moving:
        _write_out_axis(urdf, joint)
        remarks += _write_out_limits(urdf, joint)
    for name, link in urdf.links.items():
        inertial = link.find('inertial')
        if inertial is not None:
            _check_inertia(urdf, f'link {name}', inertial)
    others = [joint for joint in urdf.joints if joint not in tree and joint.type != 'fixed']
    for joint in others:
        joint.element.set('type', 'fixed')
        for element in list(joint.element):
            if element.tag in _OF_MOVING_JOINTS:
                joint.element.remove(element)
    if others:
        names = ', '.join(joint.name for joint in others)
        remarks.append(f'joints that do not lead to the tip are held at zero: {names}')
    # MuJoCo uses the order of the file where arms branch.
    for place, joint in enumerate(tree):
        urdf.robot.remove(joint.element)
        urdf.robot.insert(place, joint.element)
    return remarks


def _write_out_axis(urdf: Urdf, joint: _Joint) -> None:
    mimic = joint.element.find('mimic')
    if mimic is not None:
        raise urdf.error(
            f'joint {joint.name} mimics {mimic.get("joint")}; from the root link to the tip '
            'every joint must move by itself'
        )
    axis = child(joint.element, 'axis')
    given = urdf._numbers(axis, 'xyz', '1 0 0', f'joint {joint.name}')
    length = float(np.linalg.norm(given))
    if length < 1e-6:
        words = axis.get('xyz')
        raise urdf.error(f'joint {joint.name} has the axis {words}; expected a direction')
    axis.set('xyz', ' '.join(map(repr, (given / length).tolist())))


def _write_out_limits(urdf: Urdf, joint: _Joint) -> list[str]:
    owner = f'joint {joint.name}'
    limit = child(joint.element, 'limit')
    if joint.type == 'continuous':
        joint.element.set('type', 'revolute')
        limit.set('lower', repr(-CONTINUOUS_RANGE))
        limit.set('upper', repr(CONTINUOUS_RANGE))
    lower = urdf._number(limit, 'lower', owner)
    upper = urdf._number(limit, 'upper', owner)
    if not lower < upper:
        raise urdf.error(f'{owner} has the range {lower:g} to {upper:g}; expected lower < upper')
    if urdf._number(limit, 'velocity', owner) <= 0.0:
        raise urdf.error(f'{owner} has no velocity limit above zero; expected one')
    effort = urdf._number(limit, 'effort', owner)
    if effort < 0.0:
        raise urdf.error(f'{owner} has effort {effort:g}; expected a limit above zero')
    if effort > 0.0:
        return []
    limit.set('effort', repr(UNLIMITED_EFFORT))
    return [f'{owner} has no effort limit and counts as unlimited']


def _check_inertia(urdf: Urdf, owner: str, inertial: ET.Element) -> None:
    mass = urdf._number(inertial.find('mass'), 'value', owner)
    if mass < 0.0:
        raise urdf.error(f'{owner} has the mass {mass:g} kg; expected none below zero')
    for key in ('ixx', 'iyy', 'izz'):
        moment = urdf._number(inertial.find('inertia'), key, owner)
        if moment < 0.0:
            raise urdf.error(f'{owner} has the moment of inertia {moment:.3g} kg m^2')


def make_cylinders(urdf: Urdf, links: Mapping[str, float]) -> None:
    """Make links cylinders as in Section 5.2, by the length [m] of each, without joint friction."""
    for joint in urdf.joints:
        for dynamics in joint.element.findall('dynamics'):
            joint.element.remove(dynamics)
    for link, offset in links.items():
        length = max(abs(offset), _CYLINDER_MIN_LENGTH)
        across = _CYLINDER_MASS * (3 * _CYLINDER_RADIUS**2 + length**2) / 12
        along = _CYLINDER_MASS * _CYLINDER_RADIUS**2 / 2
        inertial = child(urdf.links[link], 'inertial')
        child(inertial, 'origin').attrib.update(xyz=f'0 0 {offset / 2!r}', rpy='0 0 0')
        child(inertial, 'mass').set('value', repr(_CYLINDER_MASS))
        child(inertial, 'inertia').attrib.update(
            ixx=repr(across), iyy=repr(across), izz=repr(along), ixy='0', ixz='0', iyz='0'
        )
