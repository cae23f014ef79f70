"""The limits: each as defined, kept in every tick at least cost, and never without a next one."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from nightly import NIGHTLY, by_day
from test_constrained import EXACT, active_rows, unexplained

from redres_ros import LAWS, Controller, RobotModel, load_task
from redres_ros.errors import ArrayError, RangeError, RepeatedNameError, UnknownNameError
from redres_ros.kernels.boxes import admit, stopping_speed
from redres_ros.limits import LIMITS, make_limits
from redres_ros.limits.joint import AccelerationLimit, VelocityLimit
from redres_ros.robot_model import RobotState, TickContext
from redres_ros.solver import solve_constrained

T = 0.002  # [s]
EVERY_PERIOD = pytest.mark.parametrize('T', [0.0005, 0.002, 0.01])
EVERY_LIMIT = pytest.mark.parametrize('name', LIMITS)
BOX = ('position', 'velocity', 'acceleration')
MARGIN = np.radians(0.5)
ROUNDING = 1e-9  # of an acceleration, a difference of velocities divided by T
COMBINATIONS = [
    BOX,
    (*BOX, 'jerk'),
    (*BOX, 'torque'),
    (*BOX, 'jerk', 'end_speed', 'torque'),
    ('velocity', 'acceleration'),
    ('position', 'velocity'),
    ('position',),
]


def acceleration_limit(model: RobotModel) -> np.ndarray:
    return np.array(model.arm.acceleration_limit)


def do_meet(boxes: np.ndarray) -> bool:
    """Whether each joint has a velocity that is in the boxes of all limits."""
    lower = boxes[:-1, 0].max(axis=0)
    upper = boxes[:-1, 1].min(axis=0)
    return bool((lower <= upper + ROUNDING).all())


def at_rest(model: RobotModel, q: np.ndarray) -> RobotState:
    return model.state(q, np.zeros(model.n))


def assert_kept(names: tuple[str, ...], q_ref, before: RobotState, dq, ddq, scale: float) -> None:
    """By the definitions alone. Jerk has seven digits of a velocity's difference."""
    model = before.model
    A = scale * acceleration_limit(model)
    if 'velocity' in names:
        assert (np.abs(dq) <= scale * model.dq_max + 1e-12).all()
    if 'acceleration' in names:
        assert (np.abs(ddq) <= A * (1.0 + ROUNDING)).all()
    if 'position' in names:
        assert (q_ref <= model.q_max - MARGIN + 1e-12).all()
        assert (q_ref >= model.q_min + MARGIN - 1e-12).all()
    if 'jerk' in names:
        J = scale * np.array(model.arm.jerk_limit or 100.0 * acceleration_limit(model))
        assert (np.abs(ddq - before.ddq_prev) <= J * T * (1.0 + 1e-6)).all()


def assert_optimal(policy, state: RobotState, dx: np.ndarray, command) -> None:
    """By the conditions of Karush, Kuhn and Tucker: the error of the task is least, and then no
    other velocity in the box is nearer to the law's.
    """
    free = policy.unconstrained(state, dx, T)
    if command.s == 1.0 and not command.active_limits:
        assert (command.dq == free.dq).all()
        return
    lower, upper = policy.limits.at(state, T).box
    error = free.J @ command.dq - command.s * free.executed
    size = np.linalg.norm(error)
    if size > 1e-8:
        A = np.column_stack((free.J, -free.executed))
        ends = np.append(lower, 0.0), np.append(upper, 1.0)
        active = active_rows(np.append(command.dq, command.s), ends)
        assert unexplained(A.T @ error / size, np.zeros((0, len(A.T))), active) < 1e3 * EXACT
    W = np.eye(len(state.q)) if free.W is None else np.asarray(free.W)
    terms = np.abs(W).max() * max(np.abs(command.dq).max(), np.abs(free.dq).max())
    active = active_rows(command.dq, (lower, upper))
    assert unexplained(W @ (command.dq - free.dq) / terms, free.J, active) < 1e2 * EXACT


@pytest.mark.parametrize(
    ('arm', 'law', 'names'), by_day(16, product(['lwr4', 'fr3', 'planar4r'], LAWS, COMBINATIONS))
)
def test_every_tick_keeps_the_limits_at_least_cost_and_leaves_a_next_one(arm, law, names):
    """From random commands, in which the arm also has to brake. Torque gives way to the box."""
    model = RobotModel.named(arm)
    names = tuple(name for name in names if name != 'torque' or model.n == 7)
    random = np.random.default_rng(sum(map(ord, f'{arm}{law}{names}')))
    scale = float(random.choice((1.0, 0.3)))
    controller = Controller(model, law, T, limits=names, limit_scale=scale)
    limits = controller.policy.limits
    q = np.array(model.arm.start)
    dq = np.zeros(model.n)
    ddq = np.zeros(model.n)
    in_reach = np.array((1.0, model.n != 4, 1.0))  # a planar arm has no y
    acted = 0
    for k in range(2000 if NIGHTLY else 200):
        if k % 50 == 0:
            dx = random.normal(scale=10.0 ** random.uniform(-2.0, 0.5), size=3) * in_reach
        before = RobotState(model, q, dq, ddq)
        assert do_meet(limits.at(before, T).boxes)
        command = controller.update(q, dx)
        assert_kept(names, command.q_ref, before, command.dq, command.ddq, scale)
        if 'torque' not in names and not command.unachieved.any():
            assert_optimal(controller.policy, before, dx, command)
            acted += bool(command.active_limits)
        q, dq, ddq = command.q_ref, command.dq, command.ddq
    assert 'torque' in names or acted or names == ('position',)


@pytest.mark.parametrize('gap', [1, 3])
@pytest.mark.parametrize('names', [BOX, (*BOX, 'jerk')])
def test_with_distance_left_for_a_gap_the_box_of_the_next_tick_is_never_empty(names, gap):
    """Joints that go from one end of their boxes to the other."""
    model = RobotModel.named('fr3')
    limits = make_limits(names, model)
    random = np.random.default_rng(0)
    q = np.array(model.arm.start)
    dq = ddq = np.zeros(model.n)
    for tick in range(4000):
        context = TickContext(gap=gap, longest_gap=12)
        bounds = limits.at(RobotState(model, q, dq, ddq, context), T)
        assert do_meet(bounds.boxes)
        if tick % 300 == 0:
            towards = random.random(model.n) < 0.5
        new = np.where(towards, *bounds.box)
        ddq = (new - dq) / T
        dq = new
        q = q + T * dq


def distance_to_stop(v: float, A: float, T: float) -> float:
    """How far a joint goes that is at v for one tick and then slows down by A T a tick."""
    distance = 0.0
    while v > 0.0:
        distance += v * T
        v -= A * T
    return distance


@EVERY_PERIOD
def test_the_stopping_speed_just_stops_in_time_and_so_does_the_next_one(T):
    random = np.random.default_rng(0)
    for _ in range(1000):
        d = 10.0 ** random.uniform(-9.0, 0.5)
        A = 10.0 ** random.uniform(0.0, 2.0)
        v = stopping_speed(d, A, T)
        assert distance_to_stop(v, A, T) == pytest.approx(d, rel=1e-9)
        assert stopping_speed(-d, A, T) == -v
        for share in (1.0, random.uniform(-1.0, 1.0)):
            after = stopping_speed(d - T * share * v, A, T)
            assert share * v - A * T <= after + 1e-12 / T  # d has 16 digits, d / T thirteen


def test_the_stopping_speed_is_defined_at_its_extremes():
    assert stopping_speed(0.3, 20.0, 1e-6) == pytest.approx(np.sqrt(2.0 * 20.0 * 0.3), rel=1e-4)
    assert stopping_speed(0.0, 20.0, T) == 0.0
    assert stopping_speed(np.inf, 20.0, T) == np.inf
    assert stopping_speed(0.1, np.inf, T) == pytest.approx(0.1 / T)


def test_boxes_are_the_scaled_values_of_the_arm(model, states):
    def box(name: str, **gains: float) -> np.ndarray:
        gains = {f'{name}.{key}': value for key, value in gains.items()}
        return make_limits((name,), model, limit_scale=0.5, gains=gains).at(states[0], T).box

    dq, q = states[0].dq_prev, states[0].q
    step = 0.5 * T * acceleration_limit(model)
    assert box('acceleration') == pytest.approx(np.array((dq - step, dq + step)))
    assert box('velocity') == pytest.approx(0.5 * np.array((-model.dq_max, model.dq_max)))
    distances = q - (model.q_min + 0.1), model.q_max - 0.1 - q
    below, above = (
        np.array([stopping_speed(*each, T) for each in zip(distance, step / T, strict=True)])
        for distance in distances
    )
    assert box('position', margin=0.1) == pytest.approx(np.array((-below, above)))


def test_torque_rows_bound_the_torque_of_the_next_command(model, states):
    random = np.random.default_rng(2)
    limits = make_limits(('torque',), model, torque_scale=0.5)
    for state in states[:20]:
        ((C, low, high),) = limits.at(state, T).rows
        dq = state.dq_prev + random.normal(size=model.n) * 0.1
        tau = state.M @ (dq - state.dq_prev) / T + state.n  # Eq. (6)
        assert C @ dq - low == pytest.approx(tau + 0.5 * model.tau_max)
        assert high - C @ dq == pytest.approx(0.5 * model.tau_max - tau)


def test_what_is_outside_the_box_is_not_allowed(model, states):
    bounds = make_limits(BOX, model).at(states[0], T)
    lower, upper = bounds.box
    assert bounds.allow((lower + upper) / 2.0)
    assert not bounds.allow(upper + 1e-6)
    assert not bounds.allow(lower - 1e-6)


def test_a_joint_outside_its_range_comes_back_within_its_acceleration(model):
    limits = make_limits(BOX, model)
    q = np.zeros(model.n)
    q[1] = model.q_max[1] + 0.2
    dq = np.zeros(model.n)
    dq[1] = 0.5  # still on its way out
    meet = []
    for _ in range(600):
        bounds = limits.at(model.state(q, dq), T)
        meet.append(do_meet(bounds.boxes))
        new = solve_constrained(np.zeros(model.n), None, [], bounds.box).dq
        assert (np.abs(new - dq) <= acceleration_limit(model) * T + 1e-12).all()
        dq = new
        q = q + T * dq
    assert not meet[0]
    assert meet[-1]
    assert q[1] == pytest.approx(model.q_max[1] - MARGIN, abs=1e-9)
    assert np.abs(dq).max() < 1e-9


@pytest.mark.parametrize('scale', [0.1, 0.001])
def test_limits_that_are_narrowed_while_the_arm_is_fast_keep_it_within_its_range(scale):
    model = RobotModel.named('lwr4_paper')
    controller = Controller(model, 'minimum_velocity', T, limits=BOX)
    q = load_task('rectangle').start
    fastest = []
    for tick in range(2500):
        if tick == 400:
            controller.set_limits(BOX, limit_scale=scale)
        command = controller.update(q, np.array((0.0, 0.6 * (tick < 400), 0.0)))
        q = command.q_ref
        fastest.append(float(np.abs(command.dq).max()))
        assert ((model.q_min <= q) & (q <= model.q_max)).all()
        assert (np.abs(command.ddq) <= acceleration_limit(model) * (1.0 + 1e-6)).all()
    assert fastest[399] > 2.0
    assert fastest[-1] < 2.0


def test_the_last_check_lets_pass_what_is_allowed_and_brakes_the_rest_within_it():
    """Of a joint each: as it is, too fast, accelerated too much, past its end, not finite."""
    asked = np.array((0.01, 0.03, 0.02, 1.001, np.nan)) * 1.0
    p = np.array((0.0, 0.0, 0.0, 0.9995, 0.0))
    v = np.array((1.0, 2.0, 1.0, 0.1, 0.5))
    A = np.full(5, 50.0)
    q_ref, dq = np.empty((2, 5))
    ends = np.full(5, -1.0), np.full(5, 1.0)
    first = admit(asked, p, v, 0.01, np.full(5, 2.0), A, *ends, q_ref, dq)
    assert first == 1
    assert dq == pytest.approx((1.0, 2.0, 1.5, 0.05, 0.0))
    assert q_ref == pytest.approx(p + 0.01 * dq)
    assert admit(q_ref, p, dq, 0.01, np.full(5, 2.0), A, *ends, asked, v) == -1


@EVERY_LIMIT
def test_every_limit_has_its_name_and_allows_less_with_a_smaller_scale(name, model):
    state = at_rest(model, np.random.default_rng(4).uniform(-1.0, 1.0, model.n))
    limits = make_limits((name,), model)
    assert list(limits.names.values()) == [name]
    wide = limits.at(state, T)
    narrow = make_limits((name,), model, limit_scale=0.5, torque_scale=0.5).at(state, T)
    if wide.rows:
        assert (narrow.rows[0][2] < wide.rows[0][2]).all()
    else:
        assert (narrow.box[1] < wide.box[1]).all()


def test_the_limit_that_resists_is_reported_with_its_joint(model):
    unit = np.eye(model.n)
    state = at_rest(model, np.zeros(model.n))
    for names, limit in ((BOX, 'acceleration'), (('position', 'velocity'), 'velocity')):
        bounds = make_limits(names, model).at(state, T)
        for sign in (1.0, -1.0):
            level = unit[2:3], np.array([9.0 * sign])
            _, active = bounds.nearest(9.0 * sign * unit[2], None, [level])
            assert active() == f'{model.joint_names[2]}: {limit}'


def test_what_is_not_in_the_table_or_twice_in_it_is_refused_by_name(model):
    for names, gains in ((('patience',), {}), (('position',), {'position.width': 1.0})):
        with pytest.raises(UnknownNameError):
            make_limits(names, model, gains=gains)
    with pytest.raises(RepeatedNameError, match='velocity'):
        make_limits(('velocity', VelocityLimit(model)), model)


@pytest.mark.parametrize('scale', [0.0, -1.0, 1.5, np.nan])
def test_a_scale_outside_its_range_is_refused(scale, model):
    with pytest.raises(RangeError):
        make_limits(BOX, model, limit_scale=scale)


def test_an_arm_without_acceleration_limits_needs_an_argument(model):
    other = RobotModel(replace(model.arm, acceleration_limit=()))
    for name in ('acceleration', 'jerk'):
        with pytest.raises(ArrayError, match=f'{name} limits of .* none known'):
            make_limits((name,), other)
    made = AccelerationLimit(other, acceleration=(10.0,) * 7)
    assert (make_limits((made,), other).acceleration == 10.0).all()


def test_a_margin_that_leaves_nothing_of_a_range_is_refused(model):
    with pytest.raises(RangeError):
        make_limits(('position',), model, gains={'position.margin': 2.0})
    narrow = RobotModel.named('lwr4')
    narrow.q_max = narrow.q_min + 0.1
    with pytest.raises(ArrayError, match=r'range of 0.1 rad; allowed: less than 0.05'):
        make_limits(('position',), narrow, gains={'position.margin': 0.06})


@pytest.mark.parametrize('robot', ['planar4r', 'iiwa7'])
def test_a_limit_of_another_arm_is_refused(model, robot):
    other = VelocityLimit(RobotModel.named(robot))
    with pytest.raises(ArrayError, match='limit velocity is of the joints'):
        Controller(model, 'minimum_velocity', T, limits=(other,))
