"""Inertias in place of a URDF's own: the paper's equal links."""

from redres_ros.robots.urdf import Joint, Urdf, child

CYLINDER_MASS = 1.0  # [kg]
CYLINDER_RADIUS = 0.06  # [m]
CYLINDER_MIN_LENGTH = 0.001  # [m]


def make_cylinders(urdf: Urdf, chain: tuple[Joint, ...]) -> None:
    """Make each moving link a solid cylinder, from its joint along z to the next (Section 5.2).

    Args:
        urdf: To be changed; joint friction goes too.
        chain: The joints from the root link to the tip, fixed ones included.
    """
    for joint in chain:
        if joint.type == 'fixed':
            continue
        for dynamics in joint.element.findall('dynamics'):
            joint.element.remove(dynamics)
        _set_cylinder(urdf, joint.child, _way_along_z(urdf, chain, joint.child))


def _way_along_z(urdf: Urdf, chain: tuple[Joint, ...], link: str) -> float:
    """From a link's frame along z, through fixed joints, to the next moving one or the end [m]."""
    following = next((j for j in (*chain, *urdf.joints) if j.parent == link), None)
    if following is None:
        return 0.0
    way = float(urdf.placement(following.element, f'joint {following.name}')[2, 3])
    if following.type == 'fixed':
        way += _way_along_z(urdf, chain, following.child)
    return way


def _set_cylinder(urdf: Urdf, link: str, offset: float) -> None:
    length = max(abs(offset), CYLINDER_MIN_LENGTH)
    across = CYLINDER_MASS * (3 * CYLINDER_RADIUS**2 + length**2) / 12
    along = CYLINDER_MASS * CYLINDER_RADIUS**2 / 2
    inertial = child(urdf.links[link], 'inertial')
    child(inertial, 'origin').attrib.update(xyz=f'0 0 {offset / 2!r}', rpy='0 0 0')
    child(inertial, 'mass').set('value', repr(CYLINDER_MASS))
    child(inertial, 'inertia').attrib.update(
        ixx=repr(across), iyy=repr(across), izz=repr(along), ixy='0', ixz='0', iyz='0'
    )
