"""The controller within limits: what it keeps, what it reports, and that nothing makes it jump."""

import numpy as np
import pytest
from nightly import NIGHTLY
from test_limits import BOX, ROUNDING, T, acceleration_limit

from redres_ros import LAWS, Controller, RobotModel, WaypointTask, make_law
from redres_ros.command import Published
from redres_ros.errors import DivergedError, UnknownNameError

DX = np.array((0.0, -0.1, 0.0))  # [m/s]
FAST = np.array((0.0, -3.0, 0.0))  # [m/s], beyond what the joints can do
LAW_NAMES = tuple(LAWS)


def test_torque_limits_are_kept_through_a_velocity(task):
    model = RobotModel.named('lwr4_paper')
    controller = Controller(model, 'minimum_velocity', T, limits=('torque',), torque_scale=0.7)
    q = task.start
    pushed = 0
    for _ in range(100):
        command = controller.update(q, 4.0 * DX)
        assert (np.abs(command.tau) <= 0.7 * model.tau_max * (1.0 + 1e-9)).all()
        pushed += command.s < 1.0
        q = command.q_ref
    assert pushed > 0


def test_limits_look_from_the_reference_that_is_integrated(model, task):
    """A servo that hangs back must not make the reference run into the end of a joint."""
    controller = Controller(model, 'minimum_velocity', T, limits=BOX)
    for _ in range(1500):
        command = controller.update(task.start, np.array((0.0, 0.0, -2.0)))
        assert (command.q_ref <= model.q_max).all()
        assert (command.q_ref >= model.q_min).all()


def underway(
    model: RobotModel, task: WaypointTask, **options: object
) -> tuple[Controller, np.ndarray]:
    """A controller at speed, and where the arm is."""
    controller = Controller(model, 'minimum_acceleration', T, **options)
    q = task.start
    for _ in range(300):
        q = controller.update(q, 3.0 * DX).q_ref
    return controller, q


@pytest.mark.parametrize('limits', [(), BOX])
def test_hold_begins_at_once_during_a_blend(model, task, limits):
    controller, q = underway(model, task, switch_time=2.0, limits=limits)
    controller.switch_law(make_law('minimum_velocity'))
    for _ in range(100):
        q = controller.update(q, 3.0 * DX).q_ref
    controller.hold()
    speeds = []
    for _ in range(1000):
        command = controller.update(q, 3.0 * DX)
        speeds.append(np.linalg.norm(command.dq))
        q = command.q_ref
    assert (np.diff(speeds) <= 1e-12).all()  # slower in every tick, from the first one on
    assert speeds[-1] == 0.0
    assert speeds[500] == pytest.approx(speeds[0] / 2.0, rel=0.02)


@pytest.mark.parametrize('limits', [(), ('velocity',), ('position', 'velocity')])
def test_limits_are_taken_off_without_a_jump(model, task, limits):
    """From crawling under narrow limits to what the task asks for."""
    controller, q = underway(model, task, limits=BOX, limit_scale=0.05, switch_time=0.5)
    controller.set_limits(limits)
    for tick in range(500):
        command = controller.update(q, 3.0 * DX)
        assert np.linalg.norm(command.ddq) < 20.0  # at once it would be 400 rad/s^2
        assert tick > 0 or command.active_limits  # of those that are taken off
        q = command.q_ref
    assert command.s == 1.0


def test_a_reset_in_motion_brakes_first(model, task):
    controller, q = underway(model, task, limits=BOX)
    controller.reset()
    stood = False
    for _ in range(50):
        command = controller.update(q, DX)
        q = command.q_ref
        stood |= not command.dq.any()
        assert (np.abs(command.ddq) <= acceleration_limit(model) * (1.0 + ROUNDING)).all()
    assert stood and command.dq.any()


@pytest.mark.parametrize('law', ['minimum_acceleration', 'minimum_velocity'])
@pytest.mark.parametrize('before', [(), BOX])
@pytest.mark.parametrize('switch_time', [0.5, 2.0])  # of a start that is over, or under way
def test_limits_on_the_acceleration_act_at_once_and_keep_what_they_say(
    model, task, switch_time, before, law
):
    controller, q = underway(model, task, switch_time=switch_time, limits=before)
    controller.switch_law(law)
    controller.set_limits(BOX, limit_scale=0.05)
    for _ in range(300):
        command = controller.update(q, 3.0 * DX)
        allowed = 0.05 * acceleration_limit(model)
        assert (np.abs(command.ddq) <= allowed * (1.0 + ROUNDING)).all()
        q = command.q_ref
    assert (np.abs(command.dq) <= 0.05 * model.dq_max + 1e-12).all()


def test_gains_of_limits_are_set_with_them(model, task):
    controller = Controller(
        model, 'minimum_velocity', T, limits=BOX, limit_gains={'position.margin': 0.5}
    )
    q = np.where(np.arange(model.n) == 3, model.q_max - 0.5, 0.5 * task.start)
    controller.update(q, np.zeros(3))
    controller.set_limits(BOX, limit_gains={'position.margin': 0.6})
    back = [controller.update(q, np.zeros(3)).dq[3] for _ in range(20)]
    assert max(back) <= 0.0 and back[-1] < 0.0


def test_limits_that_cannot_be_used_leave_those_in_force(model, task):
    controller = Controller(model, 'minimum_velocity', T, limits=BOX)
    with pytest.raises(UnknownNameError, match="unknown limit 'patience'"):
        controller.set_limits(('patience',))
    assert controller.update(task.start, FAST).s < 1.0


@pytest.mark.parametrize('law', LAWS)
def test_what_a_singularity_blocks_is_reported_throughout_a_start_and_a_switch(law, model):
    """Of the stretched arm, the way outward: all of dx is executed or reported."""
    controller = Controller(model, law, T, switch_time=0.02)
    dx = np.array((0.1, 0.0, 0.05))
    fractions = []
    for tick in range(30):
        if tick == 12:
            controller.switch_law(make_law('minimum_kinetic_energy', damping=3.0))
        command = controller.update(np.zeros(7), dx)
        seen = command.J @ command.dq + command.unachieved
        fractions.append(float(seen @ dx / (dx @ dx)))
        assert seen == pytest.approx(fractions[-1] * dx, abs=1e-9)
        assert command.unachieved[2] > 0.0
    assert np.diff(fractions[:10]).min() > 0.0
    assert fractions[9:] == pytest.approx(np.ones(21))


def test_a_law_that_runs_away_is_refused_once_and_starts_anew(model):
    """Least torque flings the stretched arm; the controller must not stay locked."""
    controller = Controller(model, 'minimum_torque', T)
    q = np.zeros(7)
    q[3] = 1e-3
    dx = np.array((0.3, 0.1, 0.2))
    reasons: list[str] = []  # of every tick, empty where it has a command
    for _ in range(3000):
        # beside a singularity dx itself asks for too much in this norm; its sender stops
        wanted = 0.0 * dx if reasons[-1:] == ['dx'] else dx
        try:
            command = controller.update(q, wanted)
        except DivergedError as error:
            reasons.append(error.reason)
            continue
        reasons.append('')
        q = command.q_ref
        assert np.abs(command.dq).max() <= 1e4
    own = np.flatnonzero(np.array(reasons) == 'its own motion')
    assert len(own) > 0
    assert (np.diff(own) > 1).all()
    assert reasons.count('') > 2700


def test_a_task_velocity_that_no_joint_could_follow_is_refused_and_changes_nothing(model, task):
    controller, calm = (
        Controller(model, 'minimum_velocity', T),
        Controller(model, 'minimum_velocity', T),
    )
    for _ in range(3):
        with pytest.raises(DivergedError, match='allowed: up to 10000; the reason is dx'):
            controller.update(task.start, np.array((1e9, 0.0, 0.0)))
        assert (controller.update(task.start, DX).dq == calm.update(task.start, DX).dq).all()


@pytest.mark.parametrize('interface', ['fri', 'fci', 'ros2_control'])
@pytest.mark.parametrize('names', [BOX, (*BOX, 'jerk')])
@pytest.mark.parametrize('arm', ['lwr4_paper', 'iiwa7', 'fr3', 'gen3'])
def test_limits_hold_in_any_order_of_changes_and_losses(arm, names, interface):
    """Limits narrowed in motion, laws, holds, joint velocities, and cycles without a command.

    Judged from where the robot is by then: it may have gone on too far, but no command leads out.
    """
    random = np.random.default_rng(12)
    model = RobotModel.named(arm)
    options = {'limits': names, 'robot_interface': interface, 'switch_time': 0.2}
    controller = Controller(model, 'minimum_velocity', T, **options)
    if interface != 'ros2_control':
        controller.gap = 4
        controller.longest_gap = 20
    lower, upper = np.clip(model.q_min, -3.0, None), np.clip(model.q_max, None, 3.0)
    q = random.uniform(lower, upper)
    dx = np.zeros(3)
    for _ in range(100 * NIGHTLY + 20):
        kind = random.integers(6)
        if kind == 0:
            controller.set_limits(names, limit_scale=float(random.choice((1.0, 0.5, 0.1, 0.02))))
        elif kind == 1:
            controller.switch_law(LAW_NAMES[random.integers(len(LAW_NAMES))])
        elif kind == 2:
            controller.hold()
        else:
            controller.resume()
            controller.follow_joints(kind == 3)
            dx = random.normal(size=controller.m) * (model.dq_max if kind == 3 else 2.0)
        for _ in range(60):
            missed = int(random.integers(1, 4)) if random.random() < 0.1 else 0
            before = controller.published or Published.at_rest(q)
            at = controller.bridged(before, missed)
            q = controller.update(q, dx[: controller.m], missed).q_ref
            dq = (q - at.q) / T
            assert (q <= np.maximum(model.q_max, at.q) + 1e-12).all()
            assert (q >= np.minimum(model.q_min, at.q) - 1e-12).all()
            assert (np.abs(dq) <= np.maximum(model.dq_max, np.abs(at.dq)) + 1e-9).all()
            assert (np.abs(dq - at.dq) <= T * acceleration_limit(model) * (1.0 + 1e-6)).all()
