"""The visual shapes of an arm, from its URDF."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from redres_ros.robots import Arm
from redres_ros.robots.urdf import Urdf

FIXED = -1  # in place of a joint, for what no joint moves

_GREY = (0.6, 0.62, 0.65)


@dataclass(frozen=True)
class Shape:
    """A shape of a link.

    Args:
        joint: The index of the moving joint that carries it; FIXED for none.
        pose: In the frame of the link which that joint moves, or in the base's, (4, 4).
        kind: 'cylinder', 'sphere' or 'box'.
        size: Of a cylinder radius and length, of a sphere its radius, of a box three edges [m].
        colour: Red, green and blue, 0 to 1.
    """

    joint: int
    pose: np.ndarray
    kind: str
    size: tuple[float, ...]
    colour: tuple[float, ...]


def shapes_of(arm: Arm) -> list[Shape]:
    """The visual shapes of an arm. Raises FileError for a URDF that cannot be used."""
    urdf = Urdf.read(arm.description())
    colours = _colours(urdf)
    shapes = []
    for link, (joint, pose) in _carriers(urdf, arm).items():
        for visual in urdf.links[link].findall('visual'):
            at = pose @ urdf.placement(visual, f'link {link}')
            colour: tuple[float, ...] = _GREY
            material = visual.find('material')
            if material is not None:
                colour = colours.get(material.get('name', ''), _GREY)
            for kind, size in _sizes(urdf, visual.find('geometry'), link):
                shapes.append(Shape(joint, at, kind, size, colour))
    return shapes


def _carriers(urdf: Urdf, arm: Arm) -> dict[str, tuple[int, np.ndarray]]:
    """Each link's moving joint, and the link's pose (4, 4) in the frame that this joint moves."""
    moving = {joint.link: index for index, joint in enumerate(arm.kinematics().joints)}
    children = {joint.child for joint in urdf.joints}
    carriers = {link: (FIXED, np.eye(4)) for link in urdf.links if link not in children}
    waiting = list(carriers)
    while waiting:
        parent = waiting.pop()
        carrier, pose = carriers[parent]
        for joint in urdf.joints:
            if joint.parent != parent:
                continue
            if joint.child in moving:
                carriers[joint.child] = (moving[joint.child], np.eye(4))
            else:
                placement = urdf.placement(joint.element, f'joint {joint.name}')
                carriers[joint.child] = (carrier, pose @ placement)
            waiting.append(joint.child)
    return carriers


def _colours(urdf: Urdf) -> dict[str, tuple[float, ...]]:
    colours = {}
    for material in urdf.robot.iter('material'):
        colour = material.find('color')
        if colour is not None:
            name = material.get('name', '')
            rgba = urdf.numbers(colour, 'rgba', '0.6 0.62 0.65 1', f'material {name}')
            colours[name] = tuple(rgba[:3].tolist())
    return colours


def _sizes(urdf: Urdf, geometry: object, link: str) -> Iterator[tuple[str, tuple[float, ...]]]:
    """Kind and size of what stands in a geometry element."""
    owner = f'a shape of link {link}'
    for element in geometry if geometry is not None else ():  # type: ignore[attr-defined]
        if element.tag == 'cylinder':
            radius = urdf.number(element, 'radius', '0', owner)
            yield 'cylinder', (radius, urdf.number(element, 'length', '0', owner))
        elif element.tag == 'sphere':
            yield 'sphere', (urdf.number(element, 'radius', '0', owner),)
        elif element.tag == 'box':
            yield 'box', tuple(urdf.numbers(element, 'size', '0 0 0', owner).tolist())
