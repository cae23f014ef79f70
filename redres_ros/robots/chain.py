"""The joints from a URDF's root link to a tip, or to several, and those that are held still."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from redres_ros.robots.urdf import Urdf, UrdfJoint, child, motion_of, set_placement, words

MOVING = ('revolute', 'continuous', 'prismatic')
CONTINUOUS_RANGE = 2000.0 * math.pi  # [rad] to either side, for a joint that turns without end
UNLIMITED_EFFORT = 1e9  # [N m] or [N], for a joint whose URDF gives none

_OF_MOVING_JOINTS = ('axis', 'limit', 'dynamics', 'mimic', 'safety_controller', 'calibration')


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
        chain.append(joint)
        link = joint.parent
    for other_root in urdf.links.keys() - above.keys() - {link}:
        raise urdf.error(
            f'links {link} and {other_root} have no parent joint; expected one root link'
        )
    return tuple(reversed(chain))


def tree_to(urdf: Urdf, tip_frames: Sequence[str]) -> tuple[UrdfJoint, ...]:
    """The joints that lead to any of some tips, fixed ones included, each after those before it.

    Where arms part they come one after the other, by the names of the joints, as in Pinocchio.

    Args:
        urdf: Where they are.
        tip_frames: Names of links.

    Raises:
        UnknownNameError: No link has a tip's name.
        FileError: The links are no tree.
    """
    chains = [_chain_to(urdf, tip_frame) for tip_frame in tip_frames]
    leading = {joint.name: joint for chain in chains for joint in chain}

    def beyond(link: str) -> Iterator[UrdfJoint]:
        for name in sorted(leading):
            if leading[name].parent == link:
                yield leading[name]
                yield from beyond(leading[name].child)

    roots = {joint.parent for joint in leading.values()} - {j.child for j in leading.values()}
    return tuple(joint for root in roots for joint in beyond(root))


def settle_chain(urdf: Urdf, chain: tuple[UrdfJoint, ...]) -> list[str]:
    """Check the joints of a chain, and write out what Pinocchio and MuJoCo would read differently.

    Axes get the length 1. A joint that turns without end becomes a revolute one with a range that
    no arm uses up, as the libraries have positions of other kinds for it.

    Args:
        urdf: URDF, which is changed.
        chain: The joints from the root link to the tip.

    Returns:
        One sentence for each number that the URDF lacks.

    Raises:
        FileError: A joint of a kind, axis or limit that cannot be used.
    """
    for joint in chain:
        if joint.type not in (*MOVING, 'fixed'):
            raise urdf.error(
                f'joint {joint.name} is {joint.type or "without a type"}; from the root link to '
                f'the tip joints may be {", ".join(MOVING)} or fixed'
            )
        urdf.placement(joint.element, f'joint {joint.name}')
    moving = [joint for joint in chain if joint.type != 'fixed']
    if not moving:
        raise urdf.error('no joint moves the tip; expected at least one from the root link to it')
    remarks: list[str] = []
    for joint in moving:
        _check_mimic(urdf, joint)
        child(joint.element, 'axis').set('xyz', words(_axis_of(urdf, joint)))
        remarks += _settle_limits(urdf, joint)
    return remarks


def _check_mimic(urdf: Urdf, joint: UrdfJoint) -> None:
    mimic = joint.element.find('mimic')
    if mimic is not None:
        raise urdf.error(
            f'joint {joint.name} mimics {mimic.get("joint")}; from the root link to the tip '
            'every joint must move by itself'
        )


def _axis_of(urdf: Urdf, joint: UrdfJoint) -> np.ndarray:
    """The joint's axis, a unit vector (3,) in its own frame. Raises FileError."""
    given = urdf.numbers(joint.element.find('axis'), 'xyz', '1 0 0', f'joint {joint.name}')
    length = float(np.linalg.norm(given))
    if length < 1e-6:
        raise urdf.error(f'joint {joint.name} has the axis {words(given)}; expected a direction')
    return given / length


def _settle_limits(urdf: Urdf, joint: UrdfJoint) -> list[str]:
    owner = f'joint {joint.name}'
    limit = child(joint.element, 'limit')
    if joint.type == 'continuous':
        joint.element.set('type', 'revolute')
        limit.set('lower', repr(-CONTINUOUS_RANGE))
        limit.set('upper', repr(CONTINUOUS_RANGE))
    lower, upper = _limits_of(urdf, joint)
    if not lower < upper:
        raise urdf.error(f'{owner} has the range {lower:g} to {upper:g}; expected lower < upper')
    if urdf.number(limit, 'velocity', '0', owner) <= 0.0:
        raise urdf.error(f'{owner} has no velocity limit above zero; expected one')
    effort = urdf.number(limit, 'effort', '0', owner)
    if effort < 0.0:
        raise urdf.error(f'{owner} has effort {effort:g}; expected a limit above zero')
    if effort > 0.0:
        return []
    limit.set('effort', repr(UNLIMITED_EFFORT))
    return [f'{owner} has no effort limit and counts as unlimited']


def _limits_of(urdf: Urdf, joint: UrdfJoint) -> tuple[float, float]:
    """The joint's lower and upper position limit [rad] or [m], 0 if the URDF has none."""
    limit = joint.element.find('limit')
    lower = urdf.number(limit, 'lower', '0', f'joint {joint.name}')
    upper = urdf.number(limit, 'upper', '0', f'joint {joint.name}')
    return lower, upper


def lock_joints(urdf: Urdf, chain: tuple[UrdfJoint, ...]) -> list[str]:
    """Turn every joint that does not lead to the tip into a fixed one.

    It is held at zero or, if zero is outside its range, in the middle; one that mimics another
    follows it. No law can move it then, and the arm still carries its weight.

    Args:
        urdf: URDF, which is changed.
        chain: The joints from the root link to the tip.

    Returns:
        One sentence that names the joints held, if there are any.

    Raises:
        FileError: A joint mimics one that is not there, or itself.
    """
    resting = {joint.name: joint for joint in urdf.joints if joint not in chain}
    moving = [joint for joint in resting.values() if joint.type != 'fixed']
    held = {joint.name: _held_at(urdf, joint, resting, ()) for joint in moving}  # [rad] or [m]
    for joint in moving:
        _fix(urdf, joint, held[joint.name])
    if not held:
        return []
    places = ', '.join(f'{name} at {position:g}' for name, position in held.items())
    return [f'joints that do not lead to the tip are held still: {places}']


def _held_at(
    urdf: Urdf, joint: UrdfJoint, resting: dict[str, UrdfJoint], followers: tuple[str, ...]
) -> float:
    """Where a joint is held; `followers` are those that mimic it, one through the other."""
    mimic = joint.element.find('mimic')
    if mimic is None:
        return _rest_position(urdf, joint)
    owner = f'joint {joint.name}'
    leader = mimic.get('joint', '')
    if leader in (*followers, joint.name):
        raise urdf.error(f'{owner} mimics itself through {leader}')
    if leader not in {known.name for known in urdf.joints}:
        raise urdf.error(f'{owner} mimics {leader!r}, which does not exist')
    position = 0.0  # of a joint of the chain: the pose in which the URDF is drawn
    if leader in resting:
        position = _held_at(urdf, resting[leader], resting, (*followers, joint.name))
    multiplier = urdf.number(mimic, 'multiplier', '1', owner)
    return multiplier * position + urdf.number(mimic, 'offset', '0', owner)


def _rest_position(urdf: Urdf, joint: UrdfJoint) -> float:
    if joint.type not in ('revolute', 'prismatic'):
        return 0.0
    lower, upper = _limits_of(urdf, joint)
    return 0.0 if lower <= 0.0 <= upper else (lower + upper) / 2.0


def _fix(urdf: Urdf, joint: UrdfJoint, position: float) -> None:
    if position:
        H = urdf.placement(joint.element, f'joint {joint.name}')
        is_prismatic = joint.type == 'prismatic'
        motion = motion_of(_axis_of(urdf, joint), position, is_prismatic=is_prismatic)
        set_placement(joint.element, H @ motion)
    joint.element.set('type', 'fixed')
    for tag in _OF_MOVING_JOINTS:
        for element in joint.element.findall(tag):
            joint.element.remove(element)
