"""The chain of joints from a URDF's root link to the tip."""

from redres_ros.errors import UnknownNameError
from redres_ros.robots.urdf import Joint, Urdf


def chain_to(urdf: Urdf, tip_frame: str) -> tuple[Joint, ...]:
    """The joints from the root link to the tip, fixed ones included.

    Args:
        urdf: Where they are; it may list them in any order.
        tip_frame: Name of a link.

    Raises:
        UnknownNameError: No link has the tip's name.
        FileError: A link hangs on two joints, or the links go round in a circle.
    """
    if tip_frame not in urdf.links:
        raise UnknownNameError('frame', tip_frame, urdf.links)
    above: dict[str, Joint] = {}
    for joint in urdf.joints:
        other = above.setdefault(joint.child, joint)
        if other is not joint:
            raise urdf.error(f'link {joint.child} hangs on two joints, {other.name}, {joint.name}')
    chain: list[Joint] = []
    link = tip_frame
    while link in above:
        joint = above[link]
        if joint in chain:
            raise urdf.error(f'joint {joint.name} is part of a circle; expected a tree')
        chain.append(joint)
        link = joint.parent
    return tuple(reversed(chain))
