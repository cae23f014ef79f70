"""What holds for every arm of the table: a further row is tested by these without another word."""

import re
from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from doubles import random_motion
from nightly import by_day
from reference_model import ReferenceModel

from redres_ros import (
    LAWS,
    Controller,
    Law,
    RobotModel,
    RobotState,
    WaypointTask,
    load_task,
    make_law,
)
from redres_ros.errors import ArrayError
from redres_ros.fake_robot.plant import MujocoPlant
from redres_ros.resolution import resolve
from redres_ros.robots import ARMS, find_arm
from redres_ros.robots.arm import DYNAMICS
from redres_ros.robots.joint_limits import JointLimits
from redres_ros.simulation.closed_loop import run
from redres_ros.simulation.recording import Recording

AGREEMENT = 1e-9  # two libraries in double precision, numbers up to some hundreds
T = 0.004  # [s]
EVERY_ARM = pytest.mark.parametrize('name', sorted(ARMS))
EVERY_LAW = pytest.mark.parametrize('law', sorted(LAWS))
EVERY_DYNAMICS = pytest.mark.parametrize('dynamics', DYNAMICS)


# --- geometry -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('name', 'tip'),
    [
        ('lwr4', (0.0, 0.0, 1.1785)),
        ('iiwa7', (0.0, 0.0, 1.266)),
        ('fr3', (0.088, 0.0, 0.926)),
        ('gen3', (0.0, -0.0246, 1.1874)),
        ('planar4r', (1.0, 0.0, 0.0)),
    ],
)
def test_at_zero_the_tip_is_where_the_data_sheet_puts_it(name, tip):
    x, _ = RobotModel.named(name).tip(np.zeros(len(ARMS[name].start)))
    assert x == pytest.approx(tip, abs=0.5e-3)  # data sheets round to a millimetre


def test_the_lwr_reaches_with_its_tool_as_far_as_in_the_paper():
    x, _ = RobotModel.named('lwr4_paper').tip(np.zeros(7))
    assert x == pytest.approx((0.0, 0.0, 0.323 + 0.400 + 0.390 + 0.213), abs=1e-12)


@EVERY_ARM
def test_the_base_offset_raises_the_tip(name):
    q = np.array(ARMS[name].start)
    low, high = (RobotModel.named(name, base_offset=z).tip(q)[0] for z in (0.0, 0.2))
    assert high - low == pytest.approx((0.0, 0.0, 0.2), abs=1e-12)


@EVERY_ARM
def test_the_tool_offset_moves_the_tip_along_its_own_axis(name):
    q = np.array(ARMS[name].start)
    x, R = RobotModel.named(name, tool_offset=0.0).tip(q)
    with_tool, _ = RobotModel.named(name, tool_offset=0.1).tip(q)
    assert with_tool == pytest.approx(x + 0.1 * R[:, 2], abs=1e-12)


@EVERY_ARM
def test_the_elbow_is_between_the_base_and_the_tip(name):
    model = RobotModel.named(name)
    q = np.array(ARMS[name].start)
    elbow = model.position(q, ARMS[name].elbow_frame)
    assert np.linalg.norm(elbow) > 0.1
    assert np.linalg.norm(elbow - model.tip(q)[0]) > 0.1


@pytest.mark.parametrize(
    ('name', 'joint_names'),
    [
        ('iiwa7', [f'lbr_A{i}' for i in range(1, 8)]),  # lbr_fri_ros2_stack
        ('fr3', [f'fr3_joint{i}' for i in range(1, 8)]),  # franka_ros2
        ('gen3', [f'joint_{i}' for i in range(1, 8)]),  # ros2_kortex
    ],
)
def test_joints_are_named_as_by_the_arms_driver(name, joint_names):
    assert list(RobotModel.named(name).joint_names) == joint_names


# --- dynamics -------------------------------------------------------------------------------------


@EVERY_ARM
@EVERY_DYNAMICS
def test_pinocchio_and_mujoco_agree(name, dynamics):
    arm = find_arm(name, dynamics=dynamics)
    model, reference = RobotModel(arm), ReferenceModel(arm)
    for q, dq in random_motion(model.n, 300):
        state = model.state(q, dq)
        seen = reference.kinematics(q) + reference.dynamics(q, dq)
        for got, expected in zip((state.x, state.R, state.J, state.M, state.n), seen, strict=True):
            assert np.abs(got - expected).max() < AGREEMENT


@EVERY_ARM
@EVERY_DYNAMICS
def test_the_inertia_matrix_is_positive_definite(name, dynamics):
    model = RobotModel.named(name, dynamics=dynamics)
    for q, dq in random_motion(model.n, 100):
        assert np.linalg.eigvalsh(model.state(q, dq).M)[0] > 0.0


@EVERY_ARM
@EVERY_DYNAMICS
def test_without_torque_the_arm_falls(name, dynamics):
    model = RobotModel.named(name, dynamics=dynamics)
    for q, dq in random_motion(model.n, 100):
        state = model.state(q, dq)
        # Eq. (6) with tau = 0. Rounding grows with the condition of M, up to 1e5, and with n.
        ddq = model.acceleration(q, dq, np.zeros(model.n))
        residual = np.abs(state.M @ ddq + state.n).max()
        assert residual < AGREEMENT * max(1.0, np.abs(ddq).max() * 1e-3)


@EVERY_ARM
def test_the_simulated_arm_stands_at_its_start(name):
    arm = find_arm(name)
    start = np.array(arm.start)
    plant = MujocoPlant(arm, T, start)
    for _ in range(250):
        plant.step(start)
    # Gravity is compensated within the effort limits: what is left is rounding.
    assert np.abs(plant.q - start).max() < 1e-9


# --- laws -----------------------------------------------------------------------------------------


def resolved(name: str, law: Law) -> Iterator[tuple[RobotState, np.ndarray, np.ndarray]]:
    """States around an arm's start, task velocities that it can execute, and joint velocities."""
    model = RobotModel.named(name)
    random = np.random.default_rng(0)
    for _ in range(50):
        q = np.array(ARMS[name].start) + random.uniform(-0.3, 0.3, model.n)
        state = model.state(q, random.normal(0.0, 0.5, model.n))
        J = state.J[:3]
        dx = J @ random.normal(0.0, 0.5, model.n)  # in its plane, of a planar arm
        yield state, dx, resolve(J, dx, law.bias(state, T), law.weight(state))


@EVERY_ARM
@EVERY_LAW
def test_every_law_executes_the_task(name, law):
    for state, dx, dq in resolved(name, make_law(law)):
        # Rounding of 1e-16 grows with the condition of W, up to 1e9 of the squared inertia matrix.
        assert np.abs(state.J[:3] @ dq - dx).max() < 1e-6 * np.abs(dq).max()


@EVERY_ARM
@EVERY_LAW
def test_every_law_is_optimal(name, law):
    law = make_law(law)
    for state, _, dq in resolved(name, law):
        *_, directions = np.linalg.svd(state.J[:3])
        rank = np.linalg.matrix_rank(state.J[:3], tol=1e-9)
        Z = directions[rank:].T  # (n, n - rank), the null space
        weight = law.weight(state)
        W = np.eye(len(dq)) if weight is None else np.asarray(weight)
        gradient = W @ (dq - law.bias(state, T))  # (n,)
        assert np.abs(Z.T @ gradient).max() < 1e-6 * max(np.abs(gradient).max(), 1.0)


# --- limits ---------------------------------------------------------------------------------------


@EVERY_ARM
def test_limits_are_finite_and_positive(name):
    limits = JointLimits.of(ARMS[name])
    assert np.isfinite(limits.lower).all()
    assert np.isfinite(limits.upper).all()
    assert (limits.lower < limits.upper).all()
    for positive in (limits.velocity, limits.acceleration):
        assert np.isfinite(positive).all()
        assert (positive > 0.0).all()


@EVERY_ARM
def test_the_arm_holds_itself_at_its_start_with_less_than_its_effort(name):
    model = RobotModel.named(name, dynamics='identified')
    gravity = model.state(np.array(ARMS[name].start), np.zeros(model.n)).n
    efforts = re.findall(r'effort="([\d.]+)"', ARMS[name].urdf.read_text())
    assert (np.abs(gravity) < 0.8 * np.array(efforts, dtype=float)).all()


# --- start and task -------------------------------------------------------------------------------


@EVERY_ARM
def test_the_start_is_well_inside_the_ranges(name):
    limits = JointLimits.of(ARMS[name])
    start = np.array(ARMS[name].start)
    assert (start - limits.lower > np.radians(10.0)).all()
    assert (limits.upper - start > np.radians(10.0)).all()


@EVERY_ARM
def test_the_start_is_away_from_where_a_driver_may_jump_by_a_turn(name):
    assert np.abs(ARMS[name].start).max() < np.radians(150.0)


@EVERY_ARM
def test_the_start_is_away_from_singularities(name):
    model = RobotModel.named(name)
    start = np.array(ARMS[name].start)
    singular_values = np.linalg.svd(model.state(start, np.zeros(model.n)).J[:3], compute_uv=False)
    used = singular_values[singular_values > 1e-9]  # a planar arm has none out of its plane
    assert used[-1] > 0.05 * used[0]


POSITION_TASKS = [(name, arm.task) for name, arm in ARMS.items()]
POSE_TASKS = [(name, f'{name}_pose') for name, arm in ARMS.items() if len(arm.start) > 5]
TASKS = POSITION_TASKS + POSE_TASKS
EVERY_TASK = pytest.mark.parametrize(('name', 'task'), TASKS)


@EVERY_TASK
def test_a_default_task_is_the_arms_own_and_begins_at_its_start(name, task):
    points = load_task(task)
    assert points.robot == name
    assert points.start == pytest.approx(ARMS[name].start, abs=1e-12)
    x, R = RobotModel.named(name).tip(points.start)
    assert np.linalg.norm(x - points.waypoints[0]) < 0.2e-3  # given to a tenth of a millimetre
    if points.orientations is not None:
        assert np.abs(R - points.orientations[0]).max() < 0.2e-3


@EVERY_TASK
def test_only_pose_tasks_have_orientations(name, task):
    assert (load_task(task).orientations is not None) == ((name, task) in POSE_TASKS)


@cache
def motion(name: str, task: str, law: str) -> tuple[WaypointTask, Recording]:
    """A default task of an arm in the ideal loop."""
    points = load_task(task)
    space = 'position' if points.orientations is None else 'pose'
    controller = Controller(RobotModel.named(name), make_law(law), T, task=space)
    return points, run(controller, points)


TWO_LAWS = ('minimum_velocity', 'minimum_acceleration')
MOTIONS = pytest.mark.parametrize(
    ('name', 'task', 'law'), by_day(8, [(*each, law) for each in TASKS for law in TWO_LAWS])
)


@pytest.mark.slow
@MOTIONS
def test_a_default_task_is_finished_in_its_time(name, task, law):
    points, recording = motion(name, task, law)
    assert recording.finished, recording.ending
    assert recording['t'][-1] < points.segments * points.segment_time + 0.5


@pytest.mark.slow
@MOTIONS
def test_a_default_task_keeps_the_limits(name, task, law):
    if task == 'rectangle':
        pytest.skip('the paper lets its arm reach its limits')
    _, recording = motion(name, task, law)
    limits = JointLimits.of(ARMS[name])
    q = recording.vectors('q1')  # (ticks, n) [rad]
    dq = recording.vectors('dq1')  # (ticks, n) [rad/s]
    ddq = np.diff(dq, axis=0, prepend=0.0) / T  # from standing still
    assert (limits.lower < q).all()
    assert (q < limits.upper).all()
    assert (np.abs(dq) < limits.velocity).all()
    assert (np.abs(ddq) < limits.acceleration).all()


# --- another tip ----------------------------------------------------------------------------------


def test_with_a_tip_nearer_to_the_base_the_joints_beyond_it_are_held():
    arm = find_arm('lwr4', tip_frame='link_5')
    model = RobotModel(arm)
    assert model.joint_names == RobotModel.named('lwr4').joint_names[:5]
    assert (arm.start, arm.task) == (ARMS['lwr4'].start[:5], '')
    whole = RobotModel.named('lwr4').state(np.array((*arm.start, 0.0, 0.0)), np.zeros(7))
    state = model.state(np.array(arm.start), np.zeros(5))
    assert state.M == pytest.approx(whole.M[:5, :5], abs=1e-12)  # rotors and weight are still there
    assert JointLimits.of(arm).acceleration.tolist() == list(ARMS['lwr4'].acceleration_limit[:5])


def test_with_a_tip_on_the_same_joints_the_tasks_are_lost_alone():
    arm = find_arm('fr3', tip_frame='fr3_link7')
    assert arm == replace(ARMS['fr3'], tip_frame='fr3_link7', task='')


def test_figures_for_other_joints_are_refused_by_name():
    arm = replace(ARMS['planar4r'], rotor_inertia=(1.0, 2.0))
    with pytest.raises(ArrayError, match=r'rotor_inertia has 2 values; .*: joint_1, joint_2'):
        RobotModel(arm)


# --- a planar arm and a task of three coordinates -------------------------------------------------


def test_the_planar_arm_leaves_its_plane_with_no_joint():
    model = RobotModel.named('planar4r')
    for q, dq in random_motion(4, 50):
        assert np.abs(model.state(q, dq).J[1]).max() < 1e-15


def test_the_planar_arm_does_of_a_velocity_what_lies_in_its_plane():
    model = RobotModel.named('planar4r')
    state = model.state(np.array(ARMS['planar4r'].start), np.zeros(4))
    J = state.J[:3]
    dq = resolve(J, np.array((0.1, 0.3, -0.2)), np.zeros(4))
    assert J @ dq == pytest.approx((0.1, 0.0, -0.2), abs=1e-12)


# --- files ----------------------------------------------------------------------------------------


def test_all_arms_together_are_small():
    assert sum(path.stat().st_size for path in {arm.urdf for arm in ARMS.values()}) < 100e3


@EVERY_ARM
def test_an_arm_is_drawn_with_primitive_shapes_only(name):
    text = ARMS[name].urdf.read_text()
    assert '<mesh' not in text
    assert text.count('<visual>') >= len(ARMS[name].start)


@pytest.mark.parametrize('name', ['iiwa7', 'fr3', 'gen3', 'planar4r'])
def test_the_head_of_a_file_names_sources_and_licences(name):
    head = ARMS[name].urdf.read_text().split('-->')[0]
    assert 'Our own file' in head
    assert re.search(r'\((Apache-2\.0|BSD-3-Clause)\)|our own arm', head)
