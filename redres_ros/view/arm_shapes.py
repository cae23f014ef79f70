"""The visual shapes of an arm, from its URDF."""

from collections.abc import Iterator
from dataclasses import dataclass
from xml.etree.ElementTree import Element

import numpy as np

from redres_ros.robots import Arm
from redres_ros.robots.urdf import Urdf

_GREY = (0.6, 0.62, 0.65)


@dataclass(frozen=True)
class Shape:
    """A shape of a link.

    Args:
        joint: Index of the moving joint that carries it, or BASE.
        pose: In the frame that this joint moves, or in the base's, (4, 4).
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
    for link, (joint, pose) in arm.kinematics().links.items():
        for visual in urdf.links[link].findall('visual'):
            at = pose @ urdf.placement(visual, f'link {link}')
            colour: tuple[float, ...] = _GREY
            material = visual.find('material')
            if material is not None:
                colour = colours.get(material.get('name', ''), _GREY)
            for kind, size in _sizes(urdf, visual.find('geometry'), link):
                shapes.append(Shape(joint, at, kind, size, colour))
    return shapes


def _colours(urdf: Urdf) -> dict[str, tuple[float, ...]]:
    colours = {}
    for material in urdf.robot.iter('material'):
        colour = material.find('color')
        if colour is not None:
            name = material.get('name', '')
            rgba = urdf.numbers(colour, 'rgba', '0.6 0.62 0.65 1', f'material {name}')
            colours[name] = tuple(rgba[:3].tolist())
    return colours


def _sizes(
    urdf: Urdf, geometry: Element | None, link: str
) -> Iterator[tuple[str, tuple[float, ...]]]:
    """Kind and size of what stands in a geometry element."""
    owner = f'a shape of link {link}'
    for element in geometry if geometry is not None else ():
        if element.tag == 'cylinder':
            radius = urdf.number(element, 'radius', '0', owner)
            yield 'cylinder', (radius, urdf.number(element, 'length', '0', owner))
        elif element.tag == 'sphere':
            yield 'sphere', (urdf.number(element, 'radius', '0', owner),)
        elif element.tag == 'box':
            yield 'box', tuple(urdf.numbers(element, 'size', '0 0 0', owner).tolist())
