"""Finds an arm by its name in the table, or by the file or the text of a URDF."""

from dataclasses import replace
from pathlib import Path

from redres_ros.errors import FileError, UnknownNameError
from redres_ros.robots.arm import Arm
from redres_ros.robots.defaults import default_acceleration, default_elbow, default_start
from redres_ros.robots.table import ARMS, find_arm
from redres_ros.robots.urdf import Urdf

_FEWEST_JOINTS = 3  # of an arm from a URDF
_ENDINGS = ('.urdf', '.xacro')  # that distinguish a file from a name
ALLOWED = (*ARMS, f'a path ending in {" or ".join(_ENDINGS)}')  # in words


def names_an_arm(robot: str) -> bool:
    """Whether a text is a name of the table, or a path as that of a URDF."""
    return robot in ARMS or Path(robot).suffix in _ENDINGS


def choose_arm(robot: str, tip_frame: str = '', elbow_frame: str = '') -> Arm:
    """The arm of a name in the table ARMS, or from a file.

    Args:
        robot: The name, or a path of a .urdf or .xacro file.
        tip_frame: The link that carries out tasks; empty: the arm's own, of a file the last link.
        elbow_frame: The link whose origin counts as the elbow; empty: the arm's own, or chosen.

    Raises:
        UnknownNameError: No such arm, or no link of the tip's or the elbow's name.
        FileError: A file that cannot be used, or that has more than one last link.
    """
    if not names_an_arm(robot):
        raise UnknownNameError('robot', robot, ALLOWED)
    if robot not in ARMS:
        return arm_from_urdf(Path(robot), tip_frame, elbow_frame)
    return find_arm(robot, tip_frame=tip_frame or None, elbow_frame=elbow_frame or None)


def arm_from_urdf(
    source: Path | str,
    tip_frame: str = '',
    elbow_frame: str = '',
    *,
    acceleration_limit: tuple[float, ...] = (),
    effort_limit: tuple[float, ...] = (),
) -> Arm:
    """Any serial arm, with defaults for what its URDF does not say; `Arm.assumptions` names them.

    Args:
        source: The file, a URDF or xacro (Path), or a URDF's text (str).
        tip_frame: The link that carries out tasks; empty: the last one of an arm without branches.
        elbow_frame: The link whose origin counts as the elbow; empty: chosen.
        acceleration_limit: Of each joint, (n,) [rad/s^2] or [m/s^2]; empty: assumed.
        effort_limit: Of each joint, (n,) [Nm] or [N]; empty: the URDF's own.

    Raises:
        FileError: The file cannot be read, has a joint that cannot be used, too few of them, or
            more than one last link.
        UnknownNameError: No link has the tip's or the elbow's name.
        ArrayError: Limits of another number of joints.
        RangeError: An effort limit that is none.
    """
    tip_frame = tip_frame or _last_link(source)
    arm = Arm(
        source,
        tip_frame,
        elbow_frame,
        acceleration_limit=acceleration_limit,
        effort_limit=effort_limit,
    )
    kinematics = arm.kinematics()
    if kinematics.n < _FEWEST_JOINTS:
        raise FileError(
            f'{arm.source}: {kinematics.n} joints move {tip_frame}; '
            f'expected at least {_FEWEST_JOINTS}, as a position has three coordinates'
        )
    if not kinematics.offsets.any():
        raise FileError(f'{arm.source}: all joints of {tip_frame} are at one point; expected links')
    elbow = elbow_frame or default_elbow(kinematics)
    acceleration = acceleration_limit or default_acceleration(kinematics)
    assumptions = []
    if not elbow_frame:
        assumptions.append(f'the elbow is {elbow}')
    if not acceleration_limit:
        assumptions.append(_assumed_accelerations(acceleration))
    return replace(
        arm,
        elbow_frame=elbow,
        acceleration_limit=acceleration,
        start=tuple(default_start(kinematics).tolist()),
        assumptions=tuple(assumptions),
    )


def _last_link(source: Path | str) -> str:
    """The link at the end of an arm without branches."""
    urdf = Urdf.read(source)
    parents = {joint.parent for joint in urdf.joints}
    ends = [link for link in urdf.links if link not in parents]
    if not ends:
        raise urdf.error('there is no last link: its joints form a circle')
    if len(ends) > 1:
        joints = {link: _joints_to(link, urdf) for link in ends}
        ends.sort(
            key=lambda link: -joints[link]
        )  # the tip of an arm first, wheels and sensors last
        listed = ', '.join(f'{link} ({joints[link]})' for link in ends)
        raise urdf.error(
            f'there are {len(ends)} last links, with so many joints before them: {listed}; '
            'choose the tip with --tip FRAME or the parameter tip_frame'
        )
    return ends[0]


def _joints_to(link: str, urdf: Urdf) -> int:
    """Number of moving joints between the root and a link."""
    joints = {joint.child: joint for joint in urdf.joints}
    count = 0
    for _ in joints:  # no more of them even if they form a circle
        if link not in joints:
            break
        count += joints[link].type != 'fixed'
        link = joints[link].parent
    return count


def _assumed_accelerations(limits: tuple[float, ...]) -> str:
    figures = ', '.join(f'{limit:g}' for limit in limits)
    return (
        f'a URDF has no acceleration limits; assumed: {figures} rad/s^2 (m/s^2 of a linear joint)'
    )
