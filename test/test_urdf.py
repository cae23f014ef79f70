"""Any URDF: what is supported works the same in Pinocchio and MuJoCo, and what is not is refused.

The arm of these tests has four joints, a gripper beside its tip, and no meshes. Each test changes
one part of it.
"""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from doubles import random_motion
from reference_model import assert_libraries_agree

from redres_ros import Controller, RobotModel, make_law
from redres_ros.errors import FileError, RedresError, UnknownNameError
from redres_ros.fake_robot.plant import MujocoPlant
from redres_ros.geometry import rotation_matrix
from redres_ros.planning.waypoints import task_for
from redres_ros.robots import ARMS, arm_from_urdf, choose_arm
from redres_ros.robots.joint_limits import JointLimits
from redres_ros.robots.urdf import CONTINUOUS_RANGE, UNLIMITED_EFFORT
from redres_ros.simulation.closed_loop import run

EXAMPLES = Path(__file__).parents[1] / 'examples'
T = 0.005  # [s]
JOINTS = ('yaw', 'shoulder', 'elbow', 'wrist')
INERTIAL = (
    '<inertial><origin xyz="0 0 0.1"/><mass value="1.5"/>'
    '<inertia ixx="0.01" iyy="0.01" izz="0.004" ixy="0" ixz="0" iyz="0"/></inertial>'
)
LIMIT = '<limit lower="-2" upper="2" velocity="3" effort="50"/>'


def joint(name: str, parent: str, child: str, inside: str, kind: str = 'revolute') -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'{inside}</joint>'
    )


FINGER = '<origin xyz="0 0.02 0.05"/><axis xyz="0 1 0"/>'
PARTS = {
    'yaw': joint('yaw', 'base', 'a', f'<origin xyz="0 0 0.2"/><axis xyz="0 0 1"/>{LIMIT}'),
    'shoulder': joint('shoulder', 'a', 'b', f'<origin xyz="0 0.05 0"/><axis xyz="0 1 0"/>{LIMIT}'),
    'elbow': joint('elbow', 'b', 'c', f'<origin xyz="0 0 0.3"/><axis xyz="0 1 0"/>{LIMIT}'),
    'wrist': joint('wrist', 'c', 'd', f'<origin xyz="0 0 0.25"/><axis xyz="1 0 0"/>{LIMIT}'),
    'tip_joint': joint('tip_joint', 'd', 'tip', '<origin xyz="0 0 0.1" rpy="0 0.3 0"/>', 'fixed'),
    'palm_joint': joint('palm_joint', 'd', 'palm', '<origin xyz="0 0 0.05"/>', 'fixed'),
    'finger': joint(
        'finger',
        'palm',
        'left',
        f'{FINGER}<limit lower="0" upper="0.04" velocity="1" effort="5"/>',
        'prismatic',
    ),
    'other_finger': joint(
        'other_finger',
        'palm',
        'right',
        '<origin xyz="0 -0.02 0.05"/><axis xyz="0 -1 0"/>'
        '<limit lower="0" upper="0.04" velocity="1" effort="5"/><mimic joint="finger"/>',
        'prismatic',
    ),
}
LINKS = ('base', 'a', 'b', 'c', 'd', 'palm', 'left', 'right')


def urdf(extra: str = '', **changed: str) -> str:
    """The arm's text, with parts replaced by others, links too, and some added."""
    links = {name: f'<link name="{name}">{INERTIAL}</link>' for name in LINKS}
    parts = links | {'tip': '<link name="tip"/>'} | PARTS | changed
    return f'<robot name="test">{"".join(parts.values())}{extra}</robot>'


def changed(part: str, old: str, new: str) -> str:
    """The arm's text with one text replaced in one of its joints or links."""
    text = PARTS.get(part, f'<link name="{part}">{INERTIAL}</link>')
    assert old in text
    return urdf(**{part: text.replace(old, new)})


def refusal(text: str, tip: str = 'tip') -> str:
    """The error of an arm that is refused at construction."""
    with pytest.raises(FileError) as refused:
        arm_from_urdf(text, tip)
    return str(refused.value)


def model_of(text: str, tip: str = 'tip') -> RobotModel:
    return RobotModel(arm_from_urdf(text, tip))


def test_a_urdf_that_would_take_all_memory_or_cannot_be_written_is_refused_in_one_line():
    links = ''.join(
        f'<link name="l{k}"/>' + joint(f'j{k}', f'l{k - 1}' if k else 'base', f'l{k}', '', 'fixed')
        for k in range(400)
    )
    assert 'more joints than 100 lead to l399' in refusal(urdf(links), 'l399')
    nested = 100_000 * '<a>' + 100_000 * '</a>'
    assert 'its elements are nested too deeply' in refusal(urdf(nested))


@pytest.mark.parametrize('kind', ['floating', 'planar', 'continuous'])
def test_joints_of_any_kind_beside_the_chain_are_held_at_zero_and_named(kind):
    text = urdf(finger=joint('finger', 'palm', 'left', '<axis xyz="0 0 1"/>', kind))
    assert model_of(text).joint_names == JOINTS
    assert 'held at zero: finger, other_finger' in ' '.join(arm_from_urdf(text, 'tip').remarks())
    assert_libraries_agree(arm_from_urdf(text, 'tip'))


def test_with_a_finger_as_the_tip_its_joint_belongs_to_the_arm():
    assert model_of(urdf(), 'left').joint_names == (*JOINTS, 'finger')
    assert_libraries_agree(arm_from_urdf(urdf(), 'left'))


def test_joints_beyond_the_tip_are_held():
    assert model_of(urdf(), 'c').joint_names == JOINTS[:3]
    assert 'wrist' in ' '.join(arm_from_urdf(urdf(), 'c').remarks())


def test_without_a_tip_the_last_links_are_listed():
    with pytest.raises(FileError, match='there are 3 last links; .* such as left, right, tip'):
        arm_from_urdf(urdf())


def test_a_link_that_is_named_as_a_tip_is_listed_first():
    tool = joint('mount', 'b', 'tool', '', 'fixed')
    with pytest.raises(FileError, match='there are 4 last links; .* such as tool, left, right'):
        arm_from_urdf(urdf(f'<link name="tool"/>{tool}'))


def test_joints_of_every_tip_move_and_all_libraries_have_them_in_the_same_order():
    arm = arm_from_urdf(urdf(), 'tip')
    arm = replace(arm, other_tips=('left',), acceleration_limit=(), start=())
    model = RobotModel(arm)
    n = len(JOINTS) + 1
    assert sorted(model.joint_names) == sorted((*JOINTS, 'finger'))
    assert JointLimits.of(arm).joint_names == model.joint_names
    assert MujocoPlant(arm, T, np.zeros(n)).joint_names == model.joint_names


def test_a_continuous_joint_turns_as_often_as_wanted():
    limit = '<limit velocity="3" effort="50"/>'
    text = urdf(wrist=PARTS['wrist'].replace(LIMIT, limit).replace('revolute', 'continuous'))
    model = model_of(text)
    assert model.q_max[3] == CONTINUOUS_RANGE
    q = np.array((0.1, 0.2, 0.3, 0.4))
    turned = q + 2.0 * np.pi * np.array((0.0, 0.0, 0.0, 100.0))
    assert model.tip(turned)[0] == pytest.approx(model.tip(q)[0], abs=1e-12)
    assert_libraries_agree(arm_from_urdf(text, 'tip'))


def test_a_prismatic_joint_moves_along_its_axis():
    text = changed('elbow', 'type="revolute"', 'type="prismatic"')
    J = model_of(text).state(np.array((0.0, 0.7, 0.2, 0.3)), np.zeros(4)).J
    assert J[:, 2] == pytest.approx((0.0, 1.0, 0.0, 0.0, 0.0, 0.0), abs=1e-12)  # its axis is y
    assert_libraries_agree(arm_from_urdf(text, 'tip'))


@pytest.mark.parametrize('axis', ['<axis xyz="0 1e-3 0"/>', '<axis xyz="3 4 12"/>', ''])
def test_an_axis_may_have_any_length_and_is_x_where_there_is_none(axis):
    text = changed('elbow', '<axis xyz="0 1 0"/>', axis)
    assert_libraries_agree(arm_from_urdf(text, 'tip'))
    J = model_of(text).state(np.zeros(4), np.zeros(4)).J
    assert axis or J[3:, 2] == pytest.approx((1.0, 0.0, 0.0), abs=1e-12)


@pytest.mark.parametrize('effort', ['', 'effort="0"'])
def test_a_joint_without_an_effort_limit_counts_as_unlimited_and_that_is_reported(effort):
    text = changed('elbow', LIMIT, f'<limit lower="-2" upper="2" velocity="3" {effort}/>')
    assert f'effort="{UNLIMITED_EFFORT!r}"' in arm_from_urdf(text, 'tip').description()
    assert 'joint elbow has no effort limit' in ' '.join(arm_from_urdf(text, 'tip').remarks())
    assert_libraries_agree(arm_from_urdf(text, 'tip'))


def test_joints_may_be_listed_in_any_order():
    joints = dict(reversed(PARTS.items()))
    other = urdf(''.join(joints.values()), **dict.fromkeys(PARTS, ''))
    model, expected = model_of(other), model_of(urdf())
    assert model.joint_names == JOINTS
    for q, dq in random_motion(4, 10):
        assert (model.state(q, dq).J == expected.state(q, dq).J).all()
    assert_libraries_agree(arm_from_urdf(other, 'tip'))


def test_the_base_frame_is_the_root_link_wherever_the_arm_stands_on_it():
    text = urdf(
        mount=joint('mount', 'floor', 'base', '<origin xyz="1 2 3" rpy="0 0 1.5"/>', 'fixed'),
        floor='<link name="floor"/>',
    )
    model, bare = model_of(text), model_of(urdf())
    q = np.array((0.1, 0.2, 0.3, 0.4))
    turn = rotation_matrix(np.array((0.0, 0.0, 1.5)))
    assert model.base_frame == 'floor'
    assert model.tip(q)[0] == pytest.approx(turn @ bare.tip(q)[0] + (1.0, 2.0, 3.0), abs=1e-12)
    assert_libraries_agree(arm_from_urdf(text, 'tip'))


NO_VELOCITY = 'joint elbow has no velocity limit above zero'


@pytest.mark.parametrize(
    ('name', 'old', 'new', 'complaint'),
    [
        ('yaw', 'type="revolute"', 'type="floating"', 'joint yaw is floating'),
        ('yaw', 'type="revolute"', 'type=""', 'joint yaw is without a type'),
        ('elbow', LIMIT, f'{LIMIT}<mimic joint="shoulder"/>', 'must move by itself'),
        ('elbow', 'axis xyz="0 1 0"', 'axis xyz="0 0 0"', 'elbow has the axis 0 0 0'),
        ('elbow', 'xyz="0 0 0.3"', 'xyz="0 0 nan"', "joint elbow has xyz '0 0 nan'; expected 3"),
        ('elbow', 'xyz="0 0 0.3"', 'xyz="0 0 1e300"', 'expected 3 numbers up to 1e+50'),
        ('elbow', 'axis xyz="0 1 0"', 'axis xyz="0 1e200 0"', "joint elbow has xyz '0 1e200 0'"),
        ('elbow', 'child link="c"', 'child link="forearm"', "the child link 'forearm' of joint"),
        ('elbow', LIMIT, '', 'joint elbow has the range 0 to 0; expected lower < upper'),
        ('elbow', 'lower="-2"', 'lower="3"', 'joint elbow has the range 3 to 2'),
        ('elbow', 'lower="-2"', 'lower="nan"', "joint elbow has lower 'nan'"),
        ('elbow', 'upper="2"', 'upper="x"', "joint elbow has upper 'x'"),
        ('elbow', 'velocity="3"', 'velocity="0"', NO_VELOCITY),
        ('elbow', 'effort="50"', 'effort="-50"', 'joint elbow has effort -50'),
        ('c', 'mass value="1.5"', 'mass value="-1.5"', 'link c has the mass -1.5 kg'),
        ('c', 'mass value="1.5"', 'mass value="nan"', "link c has value 'nan'"),
        ('c', 'ixx="0.01"', 'ixx="-0.01"', 'moment of inertia -0.01'),
        ('c', 'ixx="0.01"', 'ixx="inf"', "link c has ixx 'inf'"),
    ],
)
def test_a_part_that_cannot_be_is_refused_by_name(name, old, new, complaint):
    assert complaint in refusal(changed(name, old, new))


@pytest.mark.parametrize(
    ('text', 'tip', 'complaint'),
    [
        (urdf(), 'b', '2 joints move b; expected at least 3'),
        (urdf(), 'base', 'no joint moves the tip'),
        (re.sub('<origin[^>]*/>', '', urdf()), 'tip', 'all joints of tip are at one point'),
        (urdf('<link name="table"/>'), 'tip', 'links base and table have no parent joint'),
        (urdf(joint('strut', 'a', 'c', '', 'fixed')), 'tip', 'two parent joints, elbow, strut'),
        (urdf(joint('back', 'd', 'base', '', 'fixed')), 'tip', 'is part of a circle'),
        (urdf().replace('"elbow"', '"wrist"'), 'tip', "there are 2 joints 'wrist'"),
    ],
)
def test_a_tree_that_is_no_arm_is_refused_by_name(text, tip, complaint):
    assert complaint in refusal(text, tip)


def test_an_arm_without_any_masses_moves_but_cannot_be_simulated():
    arm = arm_from_urdf(re.sub(r'<inertial>.*?</inertial>', '', urdf()), 'tip')
    model = RobotModel(arm)
    command = Controller(model, make_law('minimum_velocity'), T).update(
        np.array(arm.start), np.array((0.01, 0.0, 0.0))
    )
    assert np.abs(command.dq).max() > 0.0
    with pytest.raises(FileError, match='MuJoCo cannot use the robot description: .*mass'):
        MujocoPlant(arm, 0.002, np.array(arm.start))


def test_the_simulated_arm_has_a_possible_inertia_where_the_urdf_has_none():
    text = urdf(c=f'<link name="c">{INERTIAL.replace("0.01", "0.001", 1)}</link>')
    arm = arm_from_urdf(text, 'tip')  # 0.001 + 0.004 < 0.01
    plant = MujocoPlant(arm, 0.002, np.array(arm.start))
    plant.step(np.array(arm.start))
    assert plant.q == pytest.approx(arm.start, abs=1e-9)


def test_errors_name_the_file(tmp_path):
    path = tmp_path / 'arm.urdf'
    path.write_text(changed('elbow', LIMIT, ''))
    with pytest.raises(FileError, match=f'^{path}: joint elbow'):
        RobotModel.from_urdf(path, 'tip')


def test_a_xacro_is_refused_with_what_makes_a_urdf_of_it(tmp_path):
    path = tmp_path / 'arm.xacro'
    xacro = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
    path.write_text(f'<robot name="a" {xacro}><link name="a"/><xacro:property name="b"/></robot>')
    with pytest.raises(FileError, match=r'arm\.xacro holds xacro; .* xacro FILE > arm\.urdf'):
        choose_arm(str(path))


def test_limits_can_be_given_in_the_place_of_those_assumed_and_of_the_urdf(tmp_path):
    path = tmp_path / 'arm.urdf'
    path.write_text(urdf())
    given = {'acceleration_limit': [1, 2, 3, 4], 'effort_limit': [5, 6, 7, 8]}
    model = RobotModel.from_urdf(path, 'tip', **given)
    assert model.arm.acceleration_limit == (1.0, 2.0, 3.0, 4.0)
    assert model.tau_max.tolist() == given['effort_limit']
    assert 'acceleration' not in ' '.join(model.arm.remarks())
    # The simulated arm has them too.
    assert model.arm.description().count('effort="7.0"') == 1


@pytest.mark.parametrize(
    ('limits', 'complaint'),
    [
        ({'effort_limit': (5.0, 6.0)}, 'effort_limit has 2 values; expected one for each joint'),
        ({'effort_limit': (5.0, 6.0, 0.0, 1.0)}, r'effort_limit is 0\.0; allowed: 0 to 1e\+09'),
        ({'effort_limit': (5.0, 6.0, np.nan, 1.0)}, 'effort_limit is nan'),
    ],
)
def test_limits_that_are_none_or_of_other_joints_are_refused(limits, complaint):
    with pytest.raises(RedresError, match=complaint):
        arm_from_urdf(urdf(), 'tip', **limits)


@pytest.mark.parametrize('name', sorted(ARMS))
def test_the_elbow_found_is_the_one_of_the_table(name):
    assert arm_from_urdf(ARMS[name].urdf, 'tool0').elbow_frame == ARMS[name].elbow_frame


def test_the_elbow_can_be_given():
    assert arm_from_urdf(urdf(), 'tip', 'palm').elbow_frame == 'palm'
    with pytest.raises(UnknownNameError, match="unknown frame 'knee'"):
        arm_from_urdf(urdf(), 'tip', 'knee')


def test_the_start_is_one_that_the_efforts_hold():
    model = RobotModel(arm_from_urdf(ARMS['fr3'].urdf, 'tool0'))

    def weight(start: tuple[float, ...]) -> np.ndarray:
        return np.abs(model.state(np.array(start), np.zeros(7)).gravity)

    weak = 1.1 * weight(model.arm.start) + 5.0
    arm = arm_from_urdf(ARMS['fr3'].urdf, 'tool0', effort_limit=tuple(weak.tolist()))
    assert (weight(arm.start) < 0.8 * weak).all()
    arm = arm_from_urdf(ARMS['fr3'].urdf, 'tool0', effort_limit=(0.1,) * 7)
    assert 'gravity takes ' in ' '.join(arm.remarks())


def test_a_start_that_efforts_just_hold_is_taken_where_none_leaves_a_margin():
    model = RobotModel(arm_from_urdf(ARMS['fr3'].urdf, 'tool0'))
    efforts = 0.125 * model.tau_max
    arm = arm_from_urdf(ARMS['fr3'].urdf, 'tool0', effort_limit=tuple(efforts.tolist()))
    gravity = model.state(np.array(arm.start), np.zeros(7)).gravity
    assert 0.8 < np.abs(gravity / efforts).max() < 1.0


def test_where_the_middle_of_the_ranges_is_well_conditioned_it_is_the_start():
    limits = JointLimits.of(ARMS['fr3'])  # bent there, other than arms that are straight at zero
    start = arm_from_urdf(ARMS['fr3'].urdf, 'tool0').start
    assert start == pytest.approx((limits.lower + limits.upper) / 2.0, abs=1e-12)


UNKNOWN = {name: (arm.urdf, 'tool0') for name, arm in ARMS.items()} | {'test': (urdf(), 'tip')}
EVERY_URDF = pytest.mark.parametrize('source', UNKNOWN.values(), ids=UNKNOWN)


@EVERY_URDF
def test_the_start_is_inside_the_ranges_and_away_from_singularities(source):
    arm = arm_from_urdf(*source)
    kinematics = arm.kinematics()
    start = np.array(arm.start)
    margin = 0.2 * (kinematics.upper - kinematics.lower)
    assert (kinematics.lower + margin < start).all()
    assert (start < kinematics.upper - margin).all()
    values = np.linalg.svd(kinematics.tip_at(start)[1][:3], compute_uv=False)
    used = values[values > 1e-9]
    assert used[-1] > 0.1 * used[0]


@pytest.mark.slow
@EVERY_URDF
@pytest.mark.parametrize('law', ['minimum_velocity', 'minimum_acceleration'])
def test_the_square_is_gone_round_within_the_limits(source, law):
    arm = arm_from_urdf(*source)
    task = task_for(arm, 'test')
    recording = run(Controller(RobotModel(arm), make_law(law), T), task)
    limits = JointLimits.of(arm)
    q, dq = recording.vectors('q1'), recording.vectors('dq1')
    ddq = np.diff(dq, axis=0, prepend=0.0) / T
    assert recording.finished, recording.ending
    assert (limits.lower < q).all()
    assert (q < limits.upper).all()
    assert (np.abs(dq) < 0.5 * limits.velocity).all()
    assert (np.abs(ddq) < limits.acceleration).all()


@EVERY_URDF
def test_the_square_begins_and_ends_at_the_tip_and_has_equal_sides(source):
    arm = arm_from_urdf(*source)
    square = task_for(arm, 'test')
    sides = np.diff(square.waypoints, axis=0)
    tip = arm.kinematics().tip_at(np.array(arm.start))[0]
    assert square.waypoints[[0, 4]] == pytest.approx(np.array((tip, tip)), abs=1e-12)
    assert np.linalg.norm(sides, axis=1) == pytest.approx(0.1, abs=1e-12)
    assert np.einsum('ij,ij->i', sides[:-1], sides[1:]) == pytest.approx(np.zeros(3), abs=1e-12)


@pytest.mark.parametrize(
    'limit',
    [
        '<limit lower="0.5" upper="0.6" velocity="3" effort="50"/>',
        '<limit lower="-2" upper="2" velocity="0.01" effort="50"/>',
    ],
    ids=['narrow', 'slow'],
)
def test_an_arm_in_a_narrow_cage_or_a_slow_one_gets_a_smaller_square(limit):
    square = task_for(arm_from_urdf(urdf().replace(LIMIT, limit), 'tip'), 'test')
    assert 0.001 <= np.linalg.norm(square.waypoints[1] - square.waypoints[0]) < 0.1
    assert square.segment_time <= 6.0 + 1e-9


def test_an_arm_that_can_move_along_a_line_only_gets_no_square():
    slide = (f'<origin xyz="0 0 0.1"/><axis xyz="0 0 1"/>{LIMIT}', 'prismatic')
    text = urdf(
        yaw=joint('yaw', 'base', 'a', *slide),
        shoulder=joint('shoulder', 'a', 'b', *slide),
        elbow=joint('elbow', 'b', 'c', *slide),
        wrist=joint('wrist', 'c', 'd', *slide),
    )
    with pytest.raises(FileError, match='slides has no task of its own, and no square'):
        task_for(arm_from_urdf(text, 'tip'), 'slides')
