"""The limits: each as defined, never empty together, kept over long motions."""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from redres_ros import Controller, RobotModel, load_task
from redres_ros.errors import ArrayError, RangeError, UnknownNameError
from redres_ros.kernels.boxes import stopping_speed
from redres_ros.limits import LIMITS, BoxLimit, Limits, limit_name, make_limits
from redres_ros.limits.joint import AccelerationLimit
from redres_ros.limits.limits import ActiveLimit
from redres_ros.resolution import resolve
from redres_ros.robot_model import RobotState, TickContext
from redres_ros.solver import solve_constrained

T = 0.002  # [s]
EVERY_PERIOD = pytest.mark.parametrize('T', [0.0005, 0.001, 0.002, 0.01])
EVERY_LIMIT = pytest.mark.parametrize('name', LIMITS)
BOXES = ('position', 'velocity', 'acceleration')
COMBINATIONS = [chosen for count in (1, 2, 3) for chosen in combinations(BOXES, count)]


def random_state(model: RobotModel, limits: Limits, random: np.random.Generator):
    """A state that keeps the box limits: inside its range, and slow enough to stop there."""
    q_min, q_max = model.q_min, model.q_max
    margin = 0.01
    q = random.uniform(q_min + margin, q_max - margin)
    end = random.random(model.n) < 0.3
    q[end] = (q_max - margin - 10.0 ** random.uniform(-9.0, -1.0, model.n))[end]
    rest = limits.at(model.state(q, np.zeros(model.n)), T)
    bounds = make_limits(('position', 'velocity'), model).at(rest_state(model, q), T).box
    dq = random.uniform(*bounds)
    at_end = random.random(model.n) < 0.3
    dq[at_end] = bounds[1][at_end]
    return model.state(q, dq), rest


def rest_state(model: RobotModel, q: np.ndarray):
    return model.state(q, np.zeros(model.n))


# --- braking --------------------------------------------------------------------------------------


def distance_to_stop(v: float, A: float, T: float) -> float:
    """How far a joint goes that is at v for one tick and then slows down by A T a tick."""
    way = 0.0
    while v > 0.0:
        way += v * T
        v -= A * T
    return way


@EVERY_PERIOD
def test_the_stopping_speed_just_stops_in_time(T):
    random = np.random.default_rng(0)
    for d in 10.0 ** random.uniform(-9.0, 0.5, 1000):
        A = 10.0 ** random.uniform(0.0, 2.0)
        v = stopping_speed(d, A, T)
        assert distance_to_stop(v, A, T) == pytest.approx(d, rel=1e-9)


def test_the_stopping_speed_tends_to_the_one_of_continuous_time():
    assert stopping_speed(0.3, 20.0, 1e-6) == pytest.approx(np.sqrt(2.0 * 20.0 * 0.3), rel=1e-4)


def test_the_stopping_speed_of_a_joint_outside_points_back():
    assert stopping_speed(-0.1, 20.0, T) == -stopping_speed(0.1, 20.0, T)
    assert stopping_speed(0.0, 20.0, T) == 0.0


def test_without_an_end_or_without_inertia_the_stopping_speed_stays_defined():
    assert stopping_speed(np.inf, 20.0, T) == np.inf
    assert stopping_speed(0.1, np.inf, T) == pytest.approx(0.1 / T)


@EVERY_PERIOD
def test_from_every_speed_that_stops_in_time_the_next_tick_has_one(T):
    random = np.random.default_rng(1)
    for _ in range(20_000):
        A = 10.0 ** random.uniform(0.0, 2.0)
        d = 10.0 ** random.uniform(-9.0, 1.0)
        v = stopping_speed(d, A, T) * (1.0 if random.random() < 0.5 else random.uniform(-1.0, 1.0))
        after = stopping_speed(d - T * v, A, T)
        assert v - A * T <= after + 1e-12 / T  # d has 16 digits, d / T thirteen


@pytest.mark.parametrize('gap', [1, 3])
@pytest.mark.parametrize('names', [BOXES, (*BOXES, 'jerk')])
def test_with_distance_left_for_a_gap_the_box_of_the_next_tick_is_never_empty(names, gap):
    model = RobotModel.named('fr3')
    limits = make_limits(names, model)
    random = np.random.default_rng(0)
    q = np.array(model.arm.start)
    dq = np.zeros(model.n)
    ddq = dq
    for tick in range(4000):
        state = RobotState(model, q, dq, ddq, TickContext(gap=gap, longest_gap=12))
        bounds = limits.at(state, T)
        assert bounds.kept
        if tick % 300 == 0:
            towards = random.random(model.n) < 0.5
        new = np.where(towards, *bounds.box)
        ddq = (new - dq) / T
        dq = new
        q = q + T * dq


# --- each limit -----------------------------------------------------------------------------------


def test_the_acceleration_box_surrounds_the_last_command(model, states):
    state = states[0]
    lower, upper = make_limits(('acceleration',), model, limit_scale=0.5).at(state, T).box
    reach = 0.5 * T * np.array(model.arm.acceleration_limit)
    assert lower == pytest.approx(state.dq_prev - reach)
    assert upper == pytest.approx(state.dq_prev + reach)


def test_the_velocity_box_is_the_scaled_row_of_the_urdf(model, states):
    lower, upper = make_limits(('velocity',), model, limit_scale=0.5).at(states[0], T).box
    assert upper == pytest.approx(0.5 * model.dq_max)
    assert lower == pytest.approx(-0.5 * model.dq_max)


def test_the_position_box_stops_short_of_the_end_by_the_margin(model):
    limits = make_limits(('position',), model, gains={'position.margin': 0.1})
    q = model.q_max - 0.1
    lower, upper = limits.at(rest_state(model, q), T).box
    assert upper == pytest.approx(np.zeros(model.n), abs=1e-12)
    assert (lower < 0.0).all()


def test_torque_rows_bound_the_torque_of_the_next_command(model, states):
    random = np.random.default_rng(2)
    limits = make_limits(('torque',), model, torque_scale=0.5)
    for state in states[:20]:
        ((C, low, high),) = limits.at(state, T).rows
        dq = state.dq_prev + random.normal(size=model.n) * 0.1
        tau = state.M @ (dq - state.dq_prev) / T + state.n  # Eq. (6)
        assert C @ dq - low == pytest.approx(tau + 0.5 * model.tau_max)
        assert high - C @ dq == pytest.approx(0.5 * model.tau_max - tau)


@dataclass(frozen=True, eq=False)
class Slow(BoxLimit):
    """A limit of one's own, in a few lines."""

    order = 1

    def box(self, state, T):
        return np.full(self.model.n, -0.2), np.full(self.model.n, 0.2)


@pytest.mark.parametrize('names', [*COMBINATIONS, ()], ids='+'.join)
@pytest.mark.parametrize('more', [False, True], ids=['alone', 'with one of my own'])
def test_a_velocity_is_said_to_keep_what_the_box_allows(names, more, model, states):
    limits = make_limits((*names, *([Slow(model)] if more else [])), model, limit_scale=0.2)
    said = []
    for state in states[:20]:
        lower, upper = limits.at(state, T).box
        inside = np.clip(state.dq_prev, lower, upper)
        for dq in (inside, inside + 1e-6, inside - 1e-6, state.dq_prev):
            said.append(limits.at(state, T).allow(dq))
            assert said[-1] == bool(((lower <= dq) & (dq <= upper)).all())
    assert True in said


# --- together -------------------------------------------------------------------------------------


def follow(model, limits, ticks, random, state, speed=3.0):
    """A long motion after random velocities of the tip, as (bounds, dq) of each tick."""
    q = state.q
    dq = state.dq_prev
    wanted = np.zeros(3)
    for k in range(ticks):
        if k % 100 == 0:
            wanted = speed * random.normal(size=3)
        state = model.state(q, dq)
        bounds = limits.at(state, T)
        free = resolve(state.J[:3], wanted, 0.98 * dq)
        bounded = solve_constrained(free, None, [(state.J[:3], wanted)], bounds.box, bounds.rows)
        yield state, bounds, bounded
        dq = bounded.dq
        q = q + T * dq


@pytest.mark.parametrize('names', COMBINATIONS, ids='+'.join)
def test_long_motions_keep_every_combination_of_box_limits(names, model, states):
    limits = make_limits(names, model)
    start = model.state(states[0].q, np.zeros(model.n))
    random = np.random.default_rng(3)
    margin = np.radians(0.5)
    A = np.array(model.arm.acceleration_limit)
    for state, bounds, bounded in follow(model, limits, 2000, random, start):
        assert bounds.kept and bounded.solved
        if 'acceleration' in names:
            assert (np.abs(bounded.dq - state.dq_prev) <= A * T + 1e-12).all()
        if 'velocity' in names:
            assert (np.abs(bounded.dq) <= model.dq_max + 1e-12).all()
        if 'position' in names:
            after = state.q + T * bounded.dq
            assert (after <= model.q_max - margin + 1e-12).all()
            assert (after >= model.q_min + margin - 1e-12).all()


@pytest.mark.parametrize('torque_scale', [0.3, 1.0])
def test_long_motions_exceed_torques_only_where_the_box_leaves_no_other(
    torque_scale, model, states
):
    limits = make_limits((*BOXES, 'torque'), model, torque_scale=torque_scale)
    start = model.state(states[0].q, np.zeros(model.n))
    random = np.random.default_rng(5)
    for state, bounds, bounded in follow(model, limits, 500, random, start):
        lower, upper = bounds.box
        assert (bounded.dq >= lower).all() and (bounded.dq <= upper).all() and bounded.solved
        tau = state.M @ (bounded.dq - state.dq_prev) / T + state.n  # Eq. (6)
        excess = np.maximum(np.abs(tau) - torque_scale * model.tau_max, 0.0)
        assert bounded.excess == pytest.approx(np.linalg.norm(excess), abs=1e-6)
        if bounded.excess > 1e-6:
            least = lsq_linear(state.M / T, excess_free_target(state, tau, excess), bounds.box)
            assert np.linalg.norm(excess) <= np.sqrt(2.0 * least.cost) + 1e-6


def excess_free_target(state, tau, excess) -> np.ndarray:
    """What M dq / T is where this torque loses its excess."""
    wanted = tau - np.sign(tau) * excess
    return wanted - state.n + state.M @ state.dq_prev / T


def test_a_joint_outside_its_range_comes_back_within_its_acceleration(model):
    limits = make_limits(BOXES, model)
    q = np.zeros(model.n)
    q[1] = model.q_max[1] + 0.2
    dq = np.zeros(model.n)
    dq[1] = 0.5  # still on its way out
    A = np.array(model.arm.acceleration_limit)
    kept = []
    for _ in range(600):
        bounds = limits.at(model.state(q, dq), T)
        kept.append(bounds.kept)
        bounded = solve_constrained(np.zeros(model.n), None, [], bounds.box)
        assert (np.abs(bounded.dq - dq) <= A * T + 1e-12).all()
        dq = bounded.dq
        q = q + T * dq
    assert not kept[0]
    assert kept[-1]
    assert q[1] == pytest.approx(model.q_max[1] - np.radians(0.5), abs=1e-9)
    assert np.abs(dq).max() < 1e-9


def test_a_joint_faster_than_a_tightened_limit_brakes_within_its_acceleration(model):
    limits = make_limits(BOXES, model, limit_scale=0.2)
    dq = 0.9 * model.dq_max
    bounds = limits.at(model.state(np.zeros(model.n), dq), T)
    reach = 0.2 * T * np.array(model.arm.acceleration_limit)
    bounded = solve_constrained(dq, None, [], bounds.box)
    assert bounded.dq == pytest.approx(dq - reach)
    assert not bounds.kept


def test_the_limit_that_resists_is_reported_with_its_joint(model):
    limits = make_limits(BOXES, model)
    q = np.zeros(model.n)
    bounds = limits.at(rest_state(model, q), T)
    unit = np.eye(model.n)
    bounded = solve_constrained(unit[2], None, [(unit[2:3], np.ones(1))], bounds.box)
    limit, joint = ActiveLimit(bounds, bounded.limiting, bounded.side).limit
    assert (limit_name(limit), joint) == ('acceleration', 2)
    assert bounded.side == 1


# --- the table ------------------------------------------------------------------------------------


@EVERY_LIMIT
def test_every_limit_keeps_its_name_and_bounds_something(name, model, states):
    (limit,) = limits = make_limits((name,), model)
    assert limit_name(limit) == name
    bounds = limits.at(states[0], T)
    lower, upper = bounds.box
    assert (lower <= upper).all()
    assert bounds.rows or np.isfinite(lower).any()


@EVERY_LIMIT
def test_a_smaller_scale_allows_less(name, model):
    random = np.random.default_rng(4)
    state = rest_state(model, random.uniform(-1.0, 1.0, model.n))
    wide = make_limits((name,), model).at(state, T)
    narrow = make_limits((name,), model, limit_scale=0.5, torque_scale=0.5).at(state, T)
    if wide.rows:
        assert (narrow.rows[0][2] < wide.rows[0][2]).all()
    else:
        assert (narrow.box[1] < wide.box[1]).all()


def test_what_is_not_in_the_table_is_refused_by_name(model):
    with pytest.raises(UnknownNameError, match='unknown limit'):
        make_limits(('speed',), model)
    with pytest.raises(UnknownNameError, match='unknown gain'):
        make_limits(('position',), model, gains={'position.width': 1.0})
    assert 'position.margin' in LIMITS.gain_keys


@pytest.mark.parametrize('scale', [0.0, -1.0, 1.5, np.nan])
def test_a_scale_outside_its_range_is_refused(scale, model):
    with pytest.raises(RangeError):
        make_limits(BOXES, model, limit_scale=scale)


def test_an_arm_without_acceleration_limits_needs_an_argument(model):
    other = RobotModel(replace(model.arm, acceleration_limit=()))
    with pytest.raises(ArrayError, match='acceleration'):
        make_limits(('acceleration',), other)
    made = AccelerationLimit(other, acceleration=(10.0,) * 7)
    assert len(make_limits((made,), other)) == 1


def test_a_margin_that_leaves_nothing_of_a_range_is_refused(model):
    with pytest.raises(RangeError):
        make_limits(('position',), model, gains={'position.margin': 2.0})


@pytest.mark.parametrize('scale', [0.1, 0.001])
def test_limits_that_are_narrowed_while_the_arm_is_fast_keep_it_within_its_range(
    scale: float,
) -> None:
    model = RobotModel.named('lwr4_paper')
    controller = Controller(model, 'minimum_velocity', T, limits=BOXES)
    q = load_task('rectangle').start
    fastest = []
    for tick in range(2500):
        if tick == 400:
            controller.set_limits(BOXES, limit_scale=scale)
        command = controller.update(q, np.array((0.0, 0.6 * (tick < 400), 0.0)))
        q = command.q_ref
        fastest.append(float(np.abs(command.dq).max()))
        assert ((model.q_min <= q) & (q <= model.q_max)).all()
        assert (np.abs(command.ddq) <= model.arm.acceleration_limit * np.array(1.0 + 1e-6)).all()
    assert fastest[399] > 2.0
    assert fastest[-1] < 2.0
