"""Finds an arm by its name in the table, or by the file or the text of a URDF."""

from pathlib import Path

from redres_ros.errors import UnknownNameError
from redres_ros.robots.arm import Arm
from redres_ros.robots.table import ARMS, arm_from_urdf, find_arm
from redres_ros.robots.urdf import Urdf

URDF_ENDINGS = ('.urdf', '.xacro')  # that distinguish a file from a name
ALLOWED = (*ARMS, f'a path ending in {" or ".join(URDF_ENDINGS)}')  # in words


def names_an_arm(robot: str) -> bool:
    """Whether a text is a name of the table, or a path as that of a URDF."""
    return robot in ARMS or Path(robot).suffix in URDF_ENDINGS


def choose_arm(robot: str, tip_frame: str = '', elbow_frame: str = '') -> Arm:
    """The arm of a name in the table ARMS, or from a file.

    Args:
        robot: The name, or a path ending in one of URDF_ENDINGS.
        tip_frame: The link that carries out tasks; empty: the arm's own, of a file the last link.
        elbow_frame: The link whose origin counts as the elbow; empty: the arm's own, or chosen.

    Raises:
        UnknownNameError: No such arm, or no link of the tip's or the elbow's name.
        FileError: A file that cannot be used, or that has more than one last link.
    """
    if not names_an_arm(robot):
        raise UnknownNameError('robot', robot, ALLOWED)
    if robot not in ARMS:
        return choose_tip(Path(robot), tip_frame, elbow_frame)
    return find_arm(robot, tip_frame=tip_frame or None, elbow_frame=elbow_frame or None)


def choose_tip(source: Path | str, tip_frame: str = '', elbow_frame: str = '') -> Arm:
    """As `choose_arm`, from the file or the text of a URDF.

    Args:
        source: A file (Path) or the text (str) of a URDF.
        tip_frame: Link at the tip; empty for the one that the URDF leaves no doubt about.
        elbow_frame: Link at the elbow; empty for one in the middle.
    """
    return arm_from_urdf(source, tip_frame or _last_link(source), elbow_frame)


def _last_link(source: Path | str) -> str:
    """The link at the end of an arm without branches."""
    urdf = Urdf.read(source)
    parents = {joint.parent for joint in urdf.joints}
    ends = [link for link in urdf.links if link not in parents]
    if not ends:
        raise urdf.error('there is no last link: its joints form a circle')
    if len(ends) > 1:
        raise urdf.error(
            f'there are {len(ends)} last links, {", ".join(ends)}; '
            'choose the tip with --tip FRAME or the parameter tip_frame'
        )
    return ends[0]
