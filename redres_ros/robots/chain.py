"""A URDF made ready for Pinocchio, MuJoCo and RViz alike: the joints that move, and inertias."""

import math
from collections.abc import Sequence
from xml.etree.ElementTree import Element

import numpy as np

from redres_ros.robots.urdf import Urdf, UrdfJoint, child

CONTINUOUS_RANGE = 2000.0 * math.pi  # [rad] to either side, for a joint that turns without end
UNLIMITED_EFFORT = 1e9  # [N m] or [N], for a joint whose URDF gives none

_MOST_JOINTS = 100  # from the root link to a tip; memory grows by the cube of their number
_MOVING = ('revolute', 'continuous', 'prismatic')
_OF_MOVING_JOINTS = ('axis', 'limit', 'dynamics', 'mimic', 'safety_controller', 'calibration')

_CYLINDER_MASS = 1.0  # [kg]
_CYLINDER_RADIUS = 0.06  # [m]
_CYLINDER_MIN_LENGTH = 0.001  # [m]


def tree_to(urdf: Urdf, tip_frames: Sequence[str]) -> tuple[UrdfJoint, ...]:
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


def _chain_to(urdf: Urdf, tip_frame: str) -> tuple[UrdfJoint, ...]:
    """The joints from the root link to a tip, fixed ones included."""
    urdf.check_link(tip_frame)
    above: dict[str, UrdfJoint] = {}
    for joint in urdf.joints:
        other = above.setdefault(joint.child, joint)
        if other is not joint:
            raise urdf.error(
                f'link {joint.child} has two parent joints, {other.name}, {joint.name}'
            )
    chain: list[UrdfJoint] = []
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


def write_out_joints(urdf: Urdf, tree: tuple[UrdfJoint, ...]) -> list[str]:
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
        urdf.placement(joint.element, f'joint {joint.name}')
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


def _write_out_axis(urdf: Urdf, joint: UrdfJoint) -> None:
    mimic = joint.element.find('mimic')
    if mimic is not None:
        raise urdf.error(
            f'joint {joint.name} mimics {mimic.get("joint")}; from the root link to the tip '
            'every joint must move by itself'
        )
    axis = child(joint.element, 'axis')
    given = urdf.numbers(axis, 'xyz', '1 0 0', f'joint {joint.name}')
    length = float(np.linalg.norm(given))
    if length < 1e-6:
        words = axis.get('xyz')
        raise urdf.error(f'joint {joint.name} has the axis {words}; expected a direction')
    axis.set('xyz', ' '.join(map(repr, (given / length).tolist())))


def _write_out_limits(urdf: Urdf, joint: UrdfJoint) -> list[str]:
    owner = f'joint {joint.name}'
    limit = child(joint.element, 'limit')
    if joint.type == 'continuous':
        joint.element.set('type', 'revolute')
        limit.set('lower', repr(-CONTINUOUS_RANGE))
        limit.set('upper', repr(CONTINUOUS_RANGE))
    lower = urdf.number(limit, 'lower', owner)
    upper = urdf.number(limit, 'upper', owner)
    if not lower < upper:
        raise urdf.error(f'{owner} has the range {lower:g} to {upper:g}; expected lower < upper')
    if urdf.number(limit, 'velocity', owner) <= 0.0:
        raise urdf.error(f'{owner} has no velocity limit above zero; expected one')
    effort = urdf.number(limit, 'effort', owner)
    if effort < 0.0:
        raise urdf.error(f'{owner} has effort {effort:g}; expected a limit above zero')
    if effort > 0.0:
        return []
    limit.set('effort', repr(UNLIMITED_EFFORT))
    return [f'{owner} has no effort limit and counts as unlimited']


def _check_inertia(urdf: Urdf, owner: str, inertial: Element) -> None:
    mass = urdf.number(inertial.find('mass'), 'value', owner)
    if mass < 0.0:
        raise urdf.error(f'{owner} has the mass {mass:g} kg; expected none below zero')
    for key in ('ixx', 'iyy', 'izz'):
        moment = urdf.number(inertial.find('inertia'), key, owner)
        if moment < 0.0:
            raise urdf.error(f'{owner} has the moment of inertia {moment:.3g} kg m^2')


def make_cylinders(urdf: Urdf, tree: tuple[UrdfJoint, ...]) -> None:
    """Make each moving link a solid cylinder, from its joint along z to the next (Section 5.2);
    joint friction is removed too.
    """
    for joint in tree:
        if joint.type == 'fixed':
            continue
        for dynamics in joint.element.findall('dynamics'):
            joint.element.remove(dynamics)
        offset = _offset_along_z(urdf, tree, joint.child)
        length = max(abs(offset), _CYLINDER_MIN_LENGTH)
        across = _CYLINDER_MASS * (3 * _CYLINDER_RADIUS**2 + length**2) / 12
        along = _CYLINDER_MASS * _CYLINDER_RADIUS**2 / 2
        inertial = child(urdf.links[joint.child], 'inertial')
        child(inertial, 'origin').attrib.update(xyz=f'0 0 {offset / 2!r}', rpy='0 0 0')
        child(inertial, 'mass').set('value', repr(_CYLINDER_MASS))
        child(inertial, 'inertia').attrib.update(
            ixx=repr(across), iyy=repr(across), izz=repr(along), ixy='0', ixz='0', iyz='0'
        )


def _offset_along_z(urdf: Urdf, tree: tuple[UrdfJoint, ...], link: str) -> float:
    """Length from a link along z, through fixed joints, to the next moving joint or the end [m]."""
    following = next((j for j in (*tree, *urdf.joints) if j.parent == link), None)
    if following is None:
        return 0.0
    offset = float(urdf.placement(following.element, f'joint {following.name}')[2, 3])
    if following.type == 'fixed':
        offset += _offset_along_z(urdf, tree, following.child)
    return offset
