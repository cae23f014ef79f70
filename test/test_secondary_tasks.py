"""The tasks that a controller carries out. One that is added to the table TASKS goes through every
test of the first part by itself.
"""

from dataclasses import replace

import numpy as np
import pytest

from redres_ros import (
    LAWS,
    TASKS,
    Controller,
    Manipulability,
    RobotState,
    Task,
    make_law,
    make_preference,
    make_task,
)
from redres_ros.errors import ArrayError, RangeError, UnknownNameError
from redres_ros.geometry import rotation_matrix, to_quaternion
from redres_ros.tasks import Axis, Joint, Orientation, Pose, Position

T = 0.002  # [s]
DX = np.array((0.0, -0.1, 0.0))  # [m/s]
EVERY_TASK = pytest.mark.parametrize('name', TASKS)
EVERY_LAW = pytest.mark.parametrize('law', LAWS)
LIMITS = ('position', 'velocity', 'acceleration')
STEP = 1e-5  # [rad]
FIVE = (1.0,) * 5


def held(name: str, state: RobotState) -> Task:
    return replace(make_task(name), target=()).with_initial_targets(state)


@EVERY_TASK
def test_the_error_of_what_is_held_is_zero(name, states):
    for state in states[:20]:
        assert held(name, state).error(state) == pytest.approx(0.0, abs=1e-12)


@EVERY_TASK
def test_the_error_changes_as_the_jacobian_says(name, model, states):
    """To first order: at the target, a step dq changes the error by -J dq."""
    for state in states[:20]:
        task = held(name, state)
        J = task.jacobian(state)
        assert J.shape == (task.rows(model), 7)
        for e, column in zip(STEP * np.eye(7), J.T, strict=True):
            ahead = task.error(model.state(state.q + e, state.dq_prev))
            behind = task.error(model.state(state.q - e, state.dq_prev))
            assert (behind - ahead) / (2.0 * STEP) == pytest.approx(column, abs=1e-8)


@EVERY_TASK
def test_a_gain_outside_its_range_is_refused(name):
    with pytest.raises(RangeError, match='task_gain is nan'):
        make_task(name, gain=np.nan)


def test_a_frame_a_joint_and_rows_are_given_after_an_at():
    assert make_task('orientation@link_4') == Orientation(frame='link_4')
    assert make_task('joint@lwr_a5_joint', gain=2.0) == Joint(joint='lwr_a5_joint', gain=2.0)
    assert make_preference('manipulability@pose') == Manipulability(rows='pose')
    for entry in ('orientation@', 'elbow@link_4', 'dance@link_4'):
        with pytest.raises(UnknownNameError, match=f"unknown task '{entry}'.*; allowed: axis"):
            make_task(entry)


@EVERY_TASK
def test_a_target_of_another_length_is_refused(name, model):
    with pytest.raises(ArrayError, match='target of .* holds 5 numbers; expected'):
        Controller(model, 'minimum_velocity', T, secondary_tasks=(make_task(name, target=FIVE),))


@EVERY_TASK
@EVERY_LAW
def test_it_never_disturbs_the_first_task(name, law, model, task):
    controller = Controller(model, make_law(law), T, secondary_tasks=(name,))
    q = task.start
    for _ in range(30):
        command = controller.update(q, DX)
        size = 1.0 + np.linalg.norm(command.dq)
        assert np.abs(command.J @ command.dq - DX).max() < 1e-10 * size
        q = command.q_ref


def follow(controller: Controller, q: np.ndarray, seconds: float) -> np.ndarray:
    for _ in range(round(seconds / controller.T)):
        q = controller.update(q, DX).q_ref
    return q


def test_an_orientation_error_fades_at_its_gain(model, task):
    """e = e_0 (1 - k T)^k, to what J changes within a tick."""
    _, R = model.tip(task.start)
    target = tuple(to_quaternion(rotation_matrix(np.array((0.1, -0.2, 0.1))) @ R))
    held = Orientation(target=target, gain=5.0)
    controller = Controller(model, make_law('minimum_velocity'), T, secondary_tasks=(held,))
    q = task.start
    for _ in range(500):
        q = controller.update(q, np.zeros(3)).q_ref
    start = held.error(model.state(task.start, np.zeros(7)))
    end = held.error(model.state(q, np.zeros(7)))
    assert end == pytest.approx(start * (1.0 - 5.0 * T) ** 500, abs=1e-4)


def test_an_axis_points_where_it_should_and_turns_freely_about_itself(model, task):
    down = Axis(gain=5.0)
    controller = Controller(model, make_law('minimum_velocity'), T, secondary_tasks=(down,))
    q = task.start
    state = model.state(q, np.zeros(7))
    assert np.linalg.norm(down.error(state)) == pytest.approx(np.arccos(-state.R[2, 2]))
    for _ in range(2000):
        q = controller.update(q, np.zeros(3)).q_ref
    _, R = model.tip(q)
    assert R[:, 2] == pytest.approx((0.0, 0.0, -1.0), abs=1e-3)
    state = model.state(q, np.zeros(7))
    rate = down.jacobian(state) @ np.linalg.pinv(state.J[3:]) @ R[:, 2]
    assert rate == pytest.approx(0.0, abs=1e-9)


def test_the_opposite_direction_is_no_dead_end(model, task):
    state = model.state(task.start, np.zeros(7))
    away = Axis(target=tuple(-state.R[:, 2]))
    assert np.linalg.norm(away.error(state)) == pytest.approx(np.pi)


def test_tasks_are_kept_in_the_order_of_priority(model, task):
    """Orientation first takes what the joint would need; the joint first, the other way round."""
    joint = Joint(joint='lwr_a5_joint', target=(0.5,), gain=5.0)
    law = make_law('minimum_velocity')
    held = (Orientation().with_initial_targets(model.state(task.start, np.zeros(7))), joint)
    errors = {}
    for order in ((Orientation(), joint), (joint, Orientation())):
        controller = Controller(model, law, T, secondary_tasks=order, limits=LIMITS)
        state = model.state(follow(controller, task.start, 1.0), np.zeros(7))
        errors[type(order[0])] = [np.linalg.norm(each.error(state)) for each in held]
    assert errors[Orientation][0] < 1e-3 < errors[Orientation][1]
    assert errors[Joint][1] < 0.02 < errors[Joint][0]


@EVERY_LAW
def test_a_pose_is_executed_far_from_singularities_whatever_the_law(law, model):
    """Cylinders make M so uneven that the metric alone would look singular."""
    random = np.random.default_rng(3)
    law = make_law(law)
    checked = 0
    while checked < 200:
        q = random.uniform(-2.0, 2.0, 7)
        state = model.state(q, np.zeros(7))
        s = np.linalg.svd(Pose().row_scale(model)[:, None] * state.J, compute_uv=False)
        if s[-1] < 0.05 * s[0]:
            continue
        checked += 1
        dx = random.normal(size=6)
        command = Controller(model, law, T, task='pose').update(q, dx)
        assert command.J @ command.dq == pytest.approx(dx, abs=1e-8 * (1 + abs(command.dq).max()))
        assert not command.unachieved.any()


@pytest.mark.parametrize(
    'lower', [Position(frame='knee'), Joint(joint='knee')], ids=['frame', 'joint']
)
def test_a_task_of_what_the_arm_has_not_got_is_refused_before_it_is_in_force(model, task, lower):
    controller = Controller(model, make_law('minimum_velocity'), T)
    with pytest.raises(UnknownNameError, match="'knee'; allowed: "):
        controller.set_policy(replace(controller.policy, secondary_tasks=(lower,)))
    controller.update(task.start, np.zeros(3))
    with pytest.raises(UnknownNameError, match="'knee'; allowed: "):
        Controller(model, make_law('minimum_velocity'), T, secondary_tasks=(lower,))


@pytest.mark.parametrize('cls', [Orientation, Axis])
def test_a_direction_of_no_length_is_refused(cls):
    length = 4 if cls is Orientation else 3
    with pytest.raises(ArrayError, match='not all zero'):
        cls(target=(0.0,) * length)
