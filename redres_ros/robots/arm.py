"""An arm: its URDF with offsets and dynamics filled in, and the data a URDF lacks."""

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from redres_ros.errors import ArrayError, FileError, RangeError, UnknownNameError
from redres_ros.files.text import read_text
from redres_ros.robots.kinematics import Kinematics
from redres_ros.robots.urdf import (
    TEXT,
    UNLIMITED_EFFORT,
    Urdf,
    child,
    make_cylinders,
    tree_to,
    write_out_joints,
)

FOLDER = Path(__file__).parent  # of the URDFs of this package
DYNAMICS = ('identified', 'cylinders')
ACCELERATIONS = (1e-3, 1e6)  # [rad/s^2] that a limit may have, as a parameter
OF_EACH_JOINT = (
    'rotor_inertia',
    'effort_limit',
    'velocity_limit',
    'acceleration_limit',
    'jerk_limit',
    'end_speeds',
    'start',
)  # fields of an arm


class EndSpeed(NamedTuple):
    """How fast a robot allows a joint to be at a distance d from the ends of its range.

    sqrt(2 deceleration d) - offset, at least 0, and at most the velocity limit.
    """

    lower: float  # position from which d counts [rad]
    upper: float  # the same
    deceleration: float  # [rad/s^2]
    offset: float  # [rad/s]


@dataclass(frozen=True)
class Arm:
    """An arm as data. `description()` is the one URDF that Pinocchio, MuJoCo and RViz read alike.

    Figures of each joint are (n,), from base to tip. Raises UnknownNameError for unknown dynamics,
    RangeError for an offset beyond 2 m or an effort limit outside its range, and FileError for a
    file that cannot be read.
    """

    urdf: Path | str  # the file, of which the text is kept, or the text of one
    tip_frame: str  # the link that carries out tasks
    elbow_frame: str = ''  # the link whose origin counts as the elbow; empty: none
    base_offset: float = 0.0  # height of the arm above the URDF's root link [m]
    tool_offset: float = 0.0  # of the tip from the flange along the flange's z [m]
    # 'identified': the URDF's own inertias with rotors and friction. 'cylinders': the paper's
    # Section 5.2 with each link a body of 1 kg, here a solid cylinder because an ideal rod makes M
    # singular.
    dynamics: str = 'identified'
    rotor_inertia: tuple[float, ...] = ()  # reflected to the joints [kg m^2]; empty: none
    # of the capsules around the base and around each link, (n + 1,) [m], 0 for none; empty: alike
    body_radius: tuple[float, ...] = ()
    acceleration_limit: tuple[float, ...] = ()  # [rad/s^2]; empty: unlimited
    jerk_limit: tuple[float, ...] = ()  # [rad/s^3]; empty: 100 1/s times the acceleration limit
    end_speeds: tuple[EndSpeed, ...] = ()  # empty: the velocity limit everywhere
    start: tuple[float, ...] = ()  # where the default task begins [rad]; empty: not chosen
    task: str = ''  # name of the default task in config/tasks; empty: none
    assumptions: tuple[str, ...] = ()  # what was assumed of the arm, a sentence each
    other_tips: tuple[str, ...] = ()  # further links whose joints move, as of a second arm
    effort_limit: tuple[float, ...] = ()  # [Nm], or [N] of a sliding joint; empty: the URDF's own
    velocity_limit: tuple[float, ...] = ()  # [rad/s]; empty: the URDF's own
    source: str = TEXT  # the URDF's name in errors

    def __post_init__(self) -> None:
        if isinstance(self.urdf, Path):
            object.__setattr__(self, 'source', str(self.urdf))
            object.__setattr__(self, 'urdf', read_text(self.urdf))
        if self.dynamics not in DYNAMICS:
            raise UnknownNameError('dynamics', self.dynamics, DYNAMICS)
        for name in ('base_offset', 'tool_offset'):
            if not -2.0 <= getattr(self, name) <= 2.0:
                raise RangeError(name, getattr(self, name), -2.0, 2.0, 'm')
        for effort in self.effort_limit:
            if not 0.0 < effort <= UNLIMITED_EFFORT:
                raise RangeError('effort_limit', effort, 0.0, UNLIMITED_EFFORT, 'Nm, above 0')

    @property
    def armature(self) -> tuple[float, ...]:
        """Rotor inertias that belong to the chosen dynamics; empty: none."""
        return self.rotor_inertia if self.dynamics == 'identified' else ()

    def description(self) -> str:
        """The URDF's text with offsets and dynamics filled in: what ROS calls robot_description.

        Only joints that lead to the tip, or to another one, move in it; all others are held still.
        Raises FileError if it cannot be used, UnknownNameError without a link of the tip's or the
        elbow's name, and ArrayError for figures of other joints.
        """
        return self._prepared()[0].text()

    def remarks(self) -> tuple[str, ...]:
        """What the user should know: assumed data, held joints. Raises as `description`."""
        return (*self.assumptions, *self._prepared()[1])

    def kinematics(self) -> Kinematics:
        """The moving joints, and the chain to the tip. Raises as `description`."""
        return Kinematics(self.description(), self.tip_frame, self.source)

    def _prepared(self) -> tuple[Urdf, list[str]]:
        """The URDF ready for use, and remarks on it."""
        urdf = Urdf.parsed(str(self.urdf), self.source)
        for mount, offset in (('base_mount', self.base_offset), ('tool_mount', self.tool_offset)):
            if offset:
                _set_offset(urdf, mount, offset)
        tree = tree_to(urdf, (self.tip_frame, *self.other_tips))
        if self.elbow_frame:
            urdf.check_link(self.elbow_frame)
        remarks = write_out_joints(urdf, tree)
        moving = [joint for joint in tree if joint.type != 'fixed']
        for field in OF_EACH_JOINT:
            values = getattr(self, field)
            if values and len(values) != len(moving):
                names = ', '.join(joint.name for joint in moving)
                expected = f'one for each joint that moves {self.tip_frame}: {names}'
                raise ArrayError(f'{field} has {len(values)} values; expected {expected}')
        given = {'effort': self.effort_limit, 'velocity': self.velocity_limit}
        for attribute, values in given.items():
            for joint, value in zip(moving, values, strict=False):
                child(joint.element, 'limit').set(attribute, repr(value))
        if self.dynamics == 'cylinders':
            kinematics = Kinematics(urdf.text(), self.tip_frame, self.source)
            links = (kinematics.joints[index].link for index in kinematics.leading)
            make_cylinders(urdf, dict(zip(links, kinematics.offsets[:, 2].tolist(), strict=True)))
        return urdf, remarks


def _set_offset(urdf: Urdf, mount: str, offset: float) -> None:
    for joint in urdf.joints:
        if joint.name == mount and joint.type == 'fixed':
            child(joint.element, 'origin').set('xyz', f'0 0 {offset!r}')
            return
    raise FileError(f'{urdf.source} has no fixed joint {mount}, which an offset needs')
