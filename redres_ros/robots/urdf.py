"""A URDF as a tree of elements: its joints, and its numbers with the defaults that URDF gives."""

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from pathlib import Path

import numpy as np
import pinocchio as pin

from redres_ros.errors import FileError, UnknownNameError, reason_of
from redres_ros.files.installation import remedy
from redres_ros.files.text import read_text

if not hasattr(pin.Model, 'armature'):  # 2.7, which pip chooses if asked for numpy 1.26, too
    raise ImportError(
        f'got Pinocchio {pin.__version__} in {pin.__file__}; allowed: 3.3.1 or newer; '
        f'remove it, then: {remedy("pinocchio")}'
    )

_LARGEST = 1e50  # number, whose square is finite as well
TEXT = 'the robot description'  # name in errors of a URDF that is no file


@dataclass(frozen=True)
class UrdfJoint:
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
            raise FileError(f'{source} holds xacro; expected the ending .xacro, or a plain URDF')
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
    def joints(self) -> tuple[UrdfJoint, ...]:
        """The joints as they are listed. Raises FileError for one without links or a name twice."""
        joints = tuple(self._joint(element) for element in self.robot.findall('joint'))
        names = [joint.name for joint in joints]
        for name in names:
            if names.count(name) > 1:
                raise self.error(f'there are {names.count(name)} joints {name!r}; expected one')
        return joints

    def _joint(self, element: ET.Element) -> UrdfJoint:
        name = element.get('name', '')
        ends = []
        for end in ('parent', 'child'):
            found = element.find(end)
            link = '' if found is None else found.get('link', '')
            if link not in self.links:
                raise self.error(f'the {end} link {link!r} of joint {name!r} does not exist')
            ends.append(link)
        return UrdfJoint(element, name, *ends)

    def numbers(
        self, element: ET.Element | None, attribute: str, default: str, owner: str
    ) -> np.ndarray:
        """An attribute's numbers, as many as in the default, of an element that may be missing.
        Raises FileError, which names the owner, for another number of them, and for one too large.
        """
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

    def number(self, element: ET.Element | None, attribute: str, owner: str) -> float:
        """An attribute's number, 0 if it is missing. Raises FileError."""
        return float(self.numbers(element, attribute, '0', owner)[0])

    def placement(self, element: ET.Element, owner: str) -> np.ndarray:
        """The pose (4, 4) that an element's origin gives; the identity without one."""
        origin = element.find('origin')
        H = np.eye(4)
        H[:3, 3] = self.numbers(origin, 'xyz', '0 0 0', owner)
        H[:3, :3] = pin.rpy.rpyToMatrix(self.numbers(origin, 'rpy', '0 0 0', owner))
        return H


def child(element: ET.Element, tag: str) -> ET.Element:
    """The element's first child of that tag, made if there is none."""
    found = element.find(tag)
    return ET.SubElement(element, tag) if found is None else found


def read_urdf(path: Path) -> str:
    """The text of a URDF file; a .xacro file is converted. Raises FileError."""
    text = read_text(path)
    if path.suffix != '.xacro':
        return text
    try:
        xacro = import_module('xacro')
    except ImportError:
        raise FileError(
            f'{path} is a xacro, which only the package xacro can read; install it '
            '(pip install xacro, or ros-jazzy-xacro), or convert the file elsewhere: xacro FILE'
        ) from None
    try:
        return str(xacro.process_file(str(path)).toxml())
    except Exception as error:  # noqa: BLE001  # a xacro evaluates expressions: of any type
        raise FileError(f'xacro cannot convert {path}: {reason_of(error)}') from None
