"""An arm of which only the URDF is known: its tip, and defaults for what the URDF does not say."""

import re
from dataclasses import replace
from itertools import combinations_with_replacement
from pathlib import Path

import numpy as np
import pinocchio as pin

from redres_ros.errors import FileError
from redres_ros.geometry import PEAK_ACCELERATION, PEAK_SPEED
from redres_ros.robots.arm import Arm
from redres_ros.robots.kinematics import Kinematics
from redres_ros.robots.urdf import Urdf, tree_to
from redres_ros.types import JointAccelerations, JointPositions, Points, Seconds

_FEWEST_JOINTS = 3  # as a position has three coordinates
_JOINTS_OF_AN_ARM = 7  # which lead to a likely tip
_TIP_NAME = re.compile(r'tool|tcp|flange|hand|(^|_)ee(_|$)', re.IGNORECASE)
_MOST_TIPS = 8  # that an error names
_REVOLUTE_ACCELERATION = 10.0  # [rad/s^2]
_PRISMATIC_ACCELERATION = 5.0  # [m/s^2]

_BENT_JOINTS = 3  # at most, of a start
_BEND = 1.0  # [rad] or [m], from the middle of such a joint's range; at most half-way to its end
_GOOD_ENOUGH = 0.4  # of the best conditioning found
_HOLDING = 0.8  # of the efforts, that gravity may take at the start

_LARGEST = 0.1  # [m], side of the square
_PLANES = ((1, 2), (0, 2), (0, 1))  # before the arm, beside it, lying: axes of the two sides
_FREE = 0.8  # of the way from the start to the end of a joint's range that the square may use
_USED = 0.3  # of the limits on velocity and acceleration that the joints may use
_SHORTEST = 1.0  # [s], of a side
_LONGEST = 6.0  # [s]; an arm with a slow joint, as a lift, gets a smaller square


def arm_from_urdf(
    source: Path | str,
    tip_frame: str = '',
    elbow_frame: str = '',
    effort_limit: tuple[float, ...] = (),
) -> Arm:
    """Any serial arm, with defaults for what its URDF does not say; `Arm.assumptions` names them.

    The source is a file (Path), or a URDF's text (str). Without a tip it is the
    last link of an arm without branches. Efforts are those of each joint, (n,).

    Raises as `Arm.description`; FileError also for too few joints, or more than one last link.
    """
    arm = Arm(source, tip_frame, elbow_frame, effort_limit=effort_limit)
    if not tip_frame:
        arm = replace(arm, tip_frame=_last_link(arm))
    kinematics = arm.kinematics()
    if kinematics.n < _FEWEST_JOINTS:
        moved = f'{kinematics.n} joints move {arm.tip_frame}'
        raise FileError(f'{arm.source}: {moved}; expected at least {_FEWEST_JOINTS}')
    if not kinematics.offsets.any():
        raise FileError(
            f'{arm.source}: all joints of {arm.tip_frame} are at one point; expected links'
        )
    assumptions = []
    if not elbow_frame:
        elbow_frame = _middle_joint(kinematics)
        assumptions.append(f'the elbow is {elbow_frame}')
    acceleration_limit = tuple(
        _PRISMATIC_ACCELERATION if joint.is_prismatic else _REVOLUTE_ACCELERATION
        for joint in kinematics.joints
    )
    figures = ', '.join(f'{limit:g}' for limit in acceleration_limit)
    assumptions.append(
        f'a URDF has no acceleration limits; assumed: {figures} rad/s^2 (m/s^2 of a linear joint)'
    )
    start, load = _start(kinematics)
    if load > 1.0:
        assumptions.append(
            f"at the start gravity takes {load:.0%} of a joint's effort, and no start was found "
            'that the efforts hold; correct them, or name a task with another start'
        )
    return replace(
        arm,
        elbow_frame=elbow_frame,
        acceleration_limit=acceleration_limit,
        start=tuple(start.tolist()),
        assumptions=tuple(assumptions),
    )


def _last_link(arm: Arm) -> str:
    """The link at the end of an arm without branches."""
    urdf = Urdf.parsed(str(arm.urdf), arm.source)
    parents = [joint.parent for joint in urdf.joints]
    ends = [link for link in urdf.links if link not in parents]
    if len(ends) == 1:
        return ends[0]
    hands = [link for link in urdf.links if parents.count(link) > 1]  # fingers begin there

    def _unlikeness(link: str) -> tuple[bool, int]:
        moving = [joint for joint in tree_to(urdf, [link]) if joint.type != 'fixed']
        return not _TIP_NAME.search(link), abs(len(moving) - _JOINTS_OF_AN_ARM)

    likely = sorted((*ends, *hands), key=_unlikeness)[:_MOST_TIPS]
    raise urdf.error(
        f'there are {len(ends)} last links; choose the tip with --tip FRAME or the parameter '
        f'tip_frame{", such as " if likely else "; the joints form a circle"}{", ".join(likely)}'
    )


def _middle_joint(kinematics: Kinematics) -> str:
    """The link of the joint nearest to the middle of the arm, along its links."""
    along = np.cumsum(np.linalg.norm(kinematics.offsets, axis=1))  # (n,) [m], the tip last
    from_middle = np.abs(np.concatenate(([0.0], along[:-1])) - along[-1] / 2.0)
    return kinematics.joints[kinematics.leading[int(np.argmin(from_middle))]].link


def _start(kinematics: Kinematics) -> tuple[JointPositions, float]:
    """A posture to begin with: the middle of the ranges, if that will do; and the largest fraction
    of a joint's effort that gravity takes there.

    There many an arm is stretched out, which is singular. Then as few joints as possible are bent,
    up to three, for a conditioning that is good enough, and for torques that hold the arm. Of
    several such postures it is the one with the tip farthest in front and above (x + z).
    """
    middle = (kinematics.lower + kinematics.upper) / 2.0
    bend = np.minimum((kinematics.upper - kinematics.lower) / 4.0, _BEND)
    n = kinematics.n
    of_one_joint = np.vstack((np.zeros(n), np.kron(np.eye(n), ((-1.0,), (1.0,)))))
    chosen = combinations_with_replacement(of_one_joint, _BENT_JOINTS)
    bends = np.clip([sum(each) for each in chosen], -1.0, 1.0)  # (N, n), of -1, 0 and 1
    postures = middle + bends * bend
    tips, jacobians = map(np.array, zip(*map(kinematics.tip_at, postures), strict=True))
    conditioning = _conditioning(kinematics, jacobians)
    is_poor = conditioning < _GOOD_ENOUGH * conditioning.max()
    model = kinematics.model
    data = model.createData()
    weight = np.array([pin.computeGeneralizedGravity(model, data, q) for q in postures])
    load = (np.abs(weight) / model.effortLimit).max(axis=1)
    bent = np.count_nonzero(bends, axis=1)
    unheld = np.digitize(load, (_HOLDING, 1.0))  # 0, 1 or 2: held with a margin, held, not
    best = np.lexsort((-tips[:, 0] - tips[:, 2], bent, is_poor, unheld))[0]
    return postures[best], float(load[best])


def _conditioning(kinematics: Kinematics, jacobians: np.ndarray) -> np.ndarray:
    """Smallest singular value (N,) of Jacobians (N, 6, n) over the largest of all."""
    reach = np.linalg.norm(kinematics.offsets, axis=1).sum()
    scaled = jacobians / np.repeat((reach, 1.0), 3)[:, None]  # no units
    rows = 6 if kinematics.n >= 6 else 3  # of the position alone for few joints
    values = np.linalg.svd(scaled[:, :rows], compute_uv=False)  # (N, k), descending
    largest = values[:, 0].max()
    rank = np.count_nonzero(values.max(axis=0) > 1e-6 * largest)  # of how the arm can move at all
    return values[:, rank - 1] / largest


def square_before_tip(
    kinematics: Kinematics, start: JointPositions, acceleration: JointAccelerations
) -> tuple[Points, Seconds] | None:
    """A square from the initial position of the tip, towards the base: five points, and the time of
    a side, in which every joint stays far below its limits. None if the tip can move in no such
    plane.

    Its sides are along y and z if the tip can move so, else along x and z, or x and y. They are
    0.1 m, or as much as the joints' ranges and speeds allow, by the Jacobian at the start.
    """
    x, J = kinematics.tip_at(start)
    J = J[:3]
    inverse = np.linalg.pinv(J, rcond=1e-2)  # without nearly singular directions
    base = kinematics.joints[0].before[:3, 3]
    inward = np.diag(np.where(x > base + 1e-6, -1.0, 1.0))  # stretched out, it cannot go outward
    free = _FREE * np.minimum(start - kinematics.lower, kinematics.upper - start)  # (n,)
    for axes in _PLANES:
        sides = inward[:, axes]  # (3, 2)
        motion = inverse @ sides  # (n, 2) of the joints per metre
        if not np.allclose(J @ motion, sides, atol=1e-6):
            continue
        rates = np.abs(motion).sum(axis=1)  # (n,) at most
        by_range = free / np.maximum(rates, 1e-9)
        by_velocity = _LONGEST * _USED * kinematics.velocity / (PEAK_SPEED * rates + 1e-9)
        side = min(_LARGEST, by_range.min(), by_velocity.min())
        first, second = side * sides.T
        waypoints = np.array((x, x + first, x + first + second, x + second, x))
        moved = side * rates  # (n,) [rad] of the joints
        times = np.append(
            PEAK_SPEED * moved / (_USED * kinematics.velocity),
            np.sqrt(PEAK_ACCELERATION * moved / (_USED * acceleration)),
        )
        longest = max(_SHORTEST, float(times.max()))
        return waypoints, float(np.ceil(10.0 * longest) / 10.0)  # to a tenth
    return None
