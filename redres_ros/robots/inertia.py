"""Inertias in place of a URDF's own: the paper's equal links, and stand-ins for missing ones."""

import xml.etree.ElementTree as ET
from collections.abc import Iterator

import numpy as np

from redres_ros.robots.urdf import Urdf, UrdfJoint, child

_CYLINDER_MASS = 1.0  # [kg]
_CYLINDER_RADIUS = 0.06  # [m]
_CYLINDER_MIN_LENGTH = 0.001  # [m]

_STAND_IN_MASS = 0.01  # [kg], of a moving part that has none
_STAND_IN_INERTIA = 1e-5  # [kg m^2], of a moving part that has none
_SMALLEST = 1e-14  # [kg m^2], of a principal moment
_TENSOR = ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')


def make_cylinders(urdf: Urdf, chain: tuple[UrdfJoint, ...]) -> None:
    """Make each moving link a solid cylinder, from its joint along z to the next (Section 5.2).

    Args:
        urdf: URDF, which is changed; joint friction is removed too.
        chain: The joints from the root link to the tip, fixed ones included.
    """
    for joint in chain:
        if joint.type == 'fixed':
            continue
        for dynamics in joint.element.findall('dynamics'):
            joint.element.remove(dynamics)
        _set_cylinder(urdf, joint.child, _offset_along_z(urdf, chain, joint.child))


def _offset_along_z(urdf: Urdf, chain: tuple[UrdfJoint, ...], link: str) -> float:
    """Length from a link along z, through fixed joints, to the next moving joint or the end [m]."""
    following = next((j for j in (*chain, *urdf.joints) if j.parent == link), None)
    if following is None:
        return 0.0
    offset = float(urdf.placement(following.element, f'joint {following.name}')[2, 3])
    if following.type == 'fixed':
        offset += _offset_along_z(urdf, chain, following.child)
    return offset


def _set_cylinder(urdf: Urdf, link: str, offset: float) -> None:
    length = max(abs(offset), _CYLINDER_MIN_LENGTH)
    across = _CYLINDER_MASS * (3 * _CYLINDER_RADIUS**2 + length**2) / 12
    along = _CYLINDER_MASS * _CYLINDER_RADIUS**2 / 2
    inertial = child(urdf.links[link], 'inertial')
    child(inertial, 'origin').attrib.update(xyz=f'0 0 {offset / 2!r}', rpy='0 0 0')
    child(inertial, 'mass').set('value', repr(_CYLINDER_MASS))
    _set_moments(inertial, across, across, along)


def fill_in_inertias(urdf: Urdf, chain: tuple[UrdfJoint, ...]) -> list[str]:
    """Give every moving part a mass and an inertia, without which it could not be simulated.

    A part is a link that a joint of the chain moves, with all that is fixed to it. Missing figures
    get stand-ins far below those of any arm.

    Args:
        urdf: URDF, which is changed; only joints of the chain move in it.
        chain: The joints from the root link to the tip.

    Returns:
        A sentence for each kind of figure that was changed.

    Raises:
        FileError: A negative mass, an indefinite inertia, NaN or infinity.
    """
    mended = [link for link in urdf.links if _mend(urdf, link)]
    filled = []
    for joint in chain:
        if joint.type == 'fixed':
            continue
        links = list(_part(urdf, joint.child))
        masses = [_mass(urdf, link) for link in links]
        moments = [_principal_moments(urdf, link)[-1] for link in links]
        if max(masses) > 0.0 and max(moments) > 0.0:
            continue
        filled.append(joint.name)
        inertial = child(urdf.links[joint.child], 'inertial')
        if max(masses) <= 0.0:
            child(inertial, 'mass').set('value', repr(_STAND_IN_MASS))
        _set_moments(inertial, _STAND_IN_INERTIA, _STAND_IN_INERTIA, _STAND_IN_INERTIA)
    remarks = []
    if mended:
        remarks.append(
            f'{_named("link", mended)} an inertia that no body can have; the mean of its moments '
            'is taken'
        )
    if filled:
        joints = ', '.join(filled)
        remarks.append(f'what joint {joints} moves has no mass or inertia and gets stand-ins')
    return remarks


def _named(kind: str, names: list[str]) -> str:
    """Such as 'link a has' or 'links a, b have'."""
    return f'{kind} {names[0]} has' if len(names) == 1 else f'{kind}s {", ".join(names)} have'


def _part(urdf: Urdf, link: str) -> Iterator[str]:
    """A link, and the links that are fixed to it."""
    yield link
    for joint in urdf.joints:
        if joint.parent == link and joint.type == 'fixed':
            yield from _part(urdf, joint.child)


def _mass(urdf: Urdf, link: str) -> float:
    mass = urdf.number(urdf.links[link].find('inertial/mass'), 'value', '0', f'link {link}')
    if mass < 0.0:
        raise urdf.error(f'link {link} has the mass {mass:g} kg; expected none below zero')
    return mass


def _tensor(urdf: Urdf, link: str) -> np.ndarray:
    """A link's inertia about its centre of mass, (3, 3) [kg m^2]; zeros if it has none."""
    inertia = urdf.links[link].find('inertial/inertia')
    xx, xy, xz, yy, yz, zz = (urdf.number(inertia, key, '0', f'link {link}') for key in _TENSOR)
    return np.array(((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)))


def _principal_moments(urdf: Urdf, link: str) -> np.ndarray:
    """Principal moments of a link's inertia, (3,) [kg m^2], ascending; zeros if it has none."""
    return np.linalg.eigvalsh(_tensor(urdf, link))


def _mend(urdf: Urdf, link: str) -> bool:
    """Give a link the mean of its principal moments if no body can have them; whether it did.

    Of any body, none is negative, and none larger than the sum of the other two: MuJoCo insists.
    """
    _write_zeros(urdf.links[link].find('inertial'))
    diagonal = np.diag(_tensor(urdf, link))
    if diagonal.min() < -1e-6 * np.abs(diagonal).max() - _SMALLEST:  # beyond rounding
        raise urdf.error(f'link {link} has the moment of inertia {diagonal.min():.3g} kg m^2')
    if 0.0 < np.abs(diagonal).max() <= _SMALLEST:
        _set_moments(child(urdf.links[link], 'inertial'), 0.0, 0.0, 0.0)
    moments = _principal_moments(urdf, link)
    possible = moments[0] > _SMALLEST and moments[0] + moments[1] >= moments[2]
    if possible or not moments[-1] > 0.0:
        return False
    mean = max(float(moments.mean()), 2.0 * _SMALLEST)
    inertial = child(urdf.links[link], 'inertial')
    _set_moments(inertial, mean, mean, mean)
    return True


def _write_zeros(inertial: ET.Element | None) -> None:
    """Write out what is missing in an inertial element, which Pinocchio's parser insists on."""
    if inertial is None:
        return
    mass = child(inertial, 'mass')
    mass.set('value', mass.get('value', '0'))
    inertia = child(inertial, 'inertia')
    for key in _TENSOR:
        inertia.set(key, inertia.get(key, '0'))


def _set_moments(inertial: ET.Element, xx: float, yy: float, zz: float) -> None:
    child(inertial, 'inertia').attrib.update(
        ixx=repr(xx), iyy=repr(yy), izz=repr(zz), ixy='0', ixz='0', iyz='0'
    )
