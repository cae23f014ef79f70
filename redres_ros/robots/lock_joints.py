"""Locks joints outside the chain to the tip, such as a gripper's."""

from redres_ros.robots.chain import axis_of, limits_of
from redres_ros.robots.urdf import Urdf, UrdfJoint, motion_of, set_placement

_OF_MOVING_JOINTS = ('axis', 'limit', 'dynamics', 'mimic', 'safety_controller', 'calibration')


def lock_joints(urdf: Urdf, chain: tuple[UrdfJoint, ...]) -> list[str]:
    """Turn every joint that does not lead to the tip into a fixed one.

    It is held at zero or, where zero is outside its range, in the middle; one that mimics another
    follows it. No law can move it then, and the arm still carries its weight.

    Args:
        urdf: To be changed.
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
        raise urdf.error(f'{owner} mimics {leader!r}, which is not there')
    position = 0.0  # of a joint of the chain: the pose in which the URDF is drawn
    if leader in resting:
        position = _held_at(urdf, resting[leader], resting, (*followers, joint.name))
    multiplier = urdf.number(mimic, 'multiplier', '1', owner)
    return multiplier * position + urdf.number(mimic, 'offset', '0', owner)


def _rest_position(urdf: Urdf, joint: UrdfJoint) -> float:
    if joint.type not in ('revolute', 'prismatic'):
        return 0.0
    lower, upper = limits_of(urdf, joint)
    return 0.0 if lower <= 0.0 <= upper else (lower + upper) / 2.0


def _fix(urdf: Urdf, joint: UrdfJoint, position: float) -> None:
    if position:
        H = urdf.placement(joint.element, f'joint {joint.name}')
        is_prismatic = joint.type == 'prismatic'
        motion = motion_of(axis_of(urdf, joint), position, is_prismatic=is_prismatic)
        set_placement(joint.element, H @ motion)
    joint.element.set('type', 'fixed')
    for tag in _OF_MOVING_JOINTS:
        for element in joint.element.findall(tag):
            joint.element.remove(element)
