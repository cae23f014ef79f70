"""What holds for every arm of the table: a further row is tested by these without another word."""

from dataclasses import replace

import numpy as np
import pytest
from nightly import by_day
from reference_model import assert_libraries_agree

from redres_ros import Controller, RobotModel, load_task, make_law
from redres_ros.errors import ArrayError
from redres_ros.fake_robot.plant import MujocoPlant
from redres_ros.robots import ARMS, find_arm
from redres_ros.robots.arm import DYNAMICS
from redres_ros.robots.joint_limits import JointLimits
from redres_ros.simulation.closed_loop import run

T = 0.004  # [s]
EVERY_ARM = pytest.mark.parametrize('name', sorted(ARMS))
EVERY_DYNAMICS = pytest.mark.parametrize('dynamics', DYNAMICS)


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


@EVERY_ARM
def test_offsets_raise_the_base_and_move_the_tip_along_its_own_axis(name):
    q = np.array(ARMS[name].start)
    x, R = RobotModel.named(name, base_offset=0.0, tool_offset=0.0).tip(q)
    moved, _ = RobotModel.named(name, base_offset=0.2, tool_offset=0.1).tip(q)
    assert moved - x == pytest.approx(0.1 * R[:, 2] + (0.0, 0.0, 0.2), abs=1e-12)


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


@EVERY_ARM
@EVERY_DYNAMICS
def test_pinocchio_and_mujoco_agree(name, dynamics):
    assert_libraries_agree(find_arm(name, dynamics=dynamics))


@EVERY_ARM
def test_the_simulated_arm_stands_at_its_start(name):
    arm = find_arm(name)
    start = np.array(arm.start)
    plant = MujocoPlant(arm, T, start)
    for _ in range(250):
        plant.step(start)
    # Gravity is compensated within the effort limits: what is left is rounding.
    assert np.abs(plant.q - start).max() < 1e-9


@EVERY_ARM
def test_the_start_is_inside_the_ranges_and_away_from_singularities(name):
    limits = JointLimits.of(ARMS[name])
    start = np.array(ARMS[name].start)
    assert (start - limits.lower > np.radians(10.0)).all()
    assert (limits.upper - start > np.radians(10.0)).all()
    assert np.abs(start).max() < np.radians(150.0)  # a driver may jump by a turn
    J = RobotModel.named(name).state(start, np.zeros(len(start))).J[:3]
    singular_values = np.linalg.svd(J, compute_uv=False)
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
    assert (points.orientations is not None) == ((name, task) in POSE_TASKS)
    if points.orientations is not None:
        assert np.abs(R - points.orientations[0]).max() < 0.2e-3


TWO_LAWS = ('minimum_velocity', 'minimum_acceleration')


@pytest.mark.slow
@pytest.mark.parametrize(
    ('name', 'task', 'law'), by_day(8, [(*each, law) for each in TASKS for law in TWO_LAWS])
)
def test_a_default_task_is_finished_in_its_time_within_the_limits(name, task, law):
    points = load_task(task)
    space = 'position' if points.orientations is None else 'pose'
    controller = Controller(RobotModel.named(name), make_law(law), T, task=space)
    recording = run(controller, points)
    assert recording.finished, recording.ending
    assert recording['t'][-1] < points.segments * points.segment_time + 0.5
    if task == 'rectangle':
        return  # the paper lets its arm reach its limits
    limits = JointLimits.of(ARMS[name])
    q = recording.vectors('q1')  # (ticks, n) [rad]
    dq = recording.vectors('dq1')  # (ticks, n) [rad/s]
    ddq = np.diff(dq, axis=0, prepend=0.0) / T  # from standing still
    assert ((limits.lower < q) & (q < limits.upper)).all()
    assert (np.abs(dq) < limits.velocity).all()
    assert (np.abs(ddq) < limits.acceleration).all()


def test_with_a_tip_nearer_to_the_base_the_joints_beyond_it_are_held():
    arm = find_arm('lwr4', tip_frame='link_5')
    model = RobotModel(arm)
    assert model.joint_names == RobotModel.named('lwr4').joint_names[:5]
    assert (arm.start, arm.task) == (ARMS['lwr4'].start[:5], '')
    whole = RobotModel.named('lwr4').state(np.array((*arm.start, 0.0, 0.0)), np.zeros(7))
    state = model.state(np.array(arm.start), np.zeros(5))
    assert state.M == pytest.approx(whole.M[:5, :5], abs=1e-12)  # rotors and weight are still there
    assert JointLimits.of(arm).acceleration.tolist() == list(ARMS['lwr4'].acceleration_limit[:5])


def test_figures_for_other_joints_are_refused_by_name():
    arm = replace(ARMS['planar4r'], rotor_inertia=(1.0, 2.0))
    with pytest.raises(ArrayError, match=r'rotor_inertia has 2 values; .*: joint_1, joint_2'):
        RobotModel(arm)
