"""The collision limit: distances as another library has them, and arms that keep them."""

from functools import cache
from itertools import pairwise, product
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest
from nightly import by_day

from redres_ros import Command, Controller, RobotModel, RobotState, make_law
from redres_ros.errors import ArrayError
from redres_ros.limits import make_limits
from redres_ros.limits.clearance import CollisionLimit
from redres_ros.robots import ARMS, Arm
from redres_ros.robots.urdf import Urdf

T = 0.002  # [s]
BOX = ('position', 'velocity', 'acceleration')
FLOOR = -1  # the number of the first wall
BALLS = (0.5, 0.2, 0.4, 0.1, -0.5, 0.0, 0.3, 0.05)
CLEARANCE = 0.02  # [m], the default
ABOUT = 1e-9  # [m], rounding
EVERY_ARM = pytest.mark.parametrize('arm', ARMS)


@cache
def model_of(arm: str) -> RobotModel:
    return RobotModel.named(arm)


def limit_of(arm: str, **gains: object) -> CollisionLimit:
    return CollisionLimit(model_of(arm), **gains)


def random_states(arm: str, count: int):
    model = model_of(arm)
    random = np.random.default_rng(0)
    still = np.zeros(model.n)
    for _ in range(count):
        q = random.uniform(np.maximum(model.q_min, -3.0), np.minimum(model.q_max, 3.0))
        yield model.state(q, still)


# --- distances ------------------------------------------------------------------------------------


def joint_pose(state: RobotState, joints: int) -> np.ndarray:
    """Of the frame that so many joints move, (4, 4), by Pinocchio."""
    model = state.model._model
    data = model.createData()
    pin.forwardKinematics(model, data, state.q)
    return data.oMi[int(joints)].homogeneous


def shape_of(limit: CollisionLimit, state, body: int):
    """A body, or a ball, in the other library: its shape and its place."""
    bodies = limit.bodies
    if body >= len(bodies.links):
        ball = np.reshape(limit.spheres, (-1, 4))[body - len(bodies.links)]
        return coal.Sphere(ball[3]), coal.Transform3s(np.eye(3), ball[:3])
    H = joint_pose(state, bodies.moved_by[body])
    ends = bodies.ends[body] @ H[:3, :3].T + H[:3, 3]
    along = ends[1] - ends[0]
    turn = pin.Quaternion.FromTwoVectors(np.array((0.0, 0.0, 1.0)), along)
    place = coal.Transform3s(turn.matrix(), ends.mean(axis=0))
    return coal.Capsule(bodies.radius[body], np.linalg.norm(along)), place


@EVERY_ARM
def test_distances_are_those_of_another_library(arm):
    limit = limit_of(arm, influence=1.0, spheres=BALLS)
    compared = 0
    for state in random_states(arm, 20):
        _, distances, who = limit.near(state)
        for distance, pair in zip(distances, who.tolist(), strict=True):
            if distance < 0.01:
                continue  # what touches has other measures
            first, second = (shape_of(limit, state, body) for body in pair)
            theirs = coal.distance(*first, *second, coal.DistanceRequest(), coal.DistanceResult())
            assert distance == pytest.approx(theirs, abs=1e-9)
            compared += 1
    assert compared > 50


def height_of(bodies, body: int, state) -> float:
    """Of a body's lowest point [m]."""
    H = joint_pose(state, bodies.moved_by[body])
    return float((bodies.ends[body] @ H[2, :3] + H[2, 3]).min() - bodies.radius[body])


@EVERY_ARM
def test_the_floor_is_below_the_lower_end(arm):
    limit = limit_of(arm, influence=1.0, floor=-0.3)
    for state in random_states(arm, 5):
        _, distances, who = limit.near(state)
        for i in np.flatnonzero(who[:, 1] == FLOOR):
            height = height_of(limit.bodies, who[i, 0], state)
            assert distances[i] == pytest.approx(height + 0.3, abs=1e-12)


@EVERY_ARM
def test_a_base_that_stands_on_the_floor_is_not_looked_at(arm):
    """No joint moves it, and the path of an arm was looked at in every tick because of it."""
    limit = limit_of(arm, floor=0.0, spheres=BALLS)
    fixed = limit.scene.moved_by < 0
    one, other = limit.scene.pairs.T
    assert not (fixed[one] & ((other < 0) | fixed[other])).any()


@EVERY_ARM
def test_rows_say_how_fast_bodies_approach(arm):
    """Against central differences; where bodies in line change their nearest points, none exist."""
    limit = limit_of(arm, influence=1.0, floor=0.0, spheres=BALLS)
    model = model_of(arm)
    random = np.random.default_rng(1)
    step = 1e-6
    off = []
    for state in random_states(arm, 20):
        dq = random.normal(size=model.n)
        C, _, who = limit.near(state)
        _, after, who_after = limit.near(model.state(state.q + step * dq, dq))
        _, before, who_before = limit.near(model.state(state.q - step * dq, dq))
        if who.tolist() == who_after.tolist() == who_before.tolist():
            off.extend(np.abs(C @ dq + (after - before) / (2.0 * step)))
    assert len(off) > 50
    assert np.quantile(off, 0.99) < 1e-6


@EVERY_ARM
def test_an_arm_has_bodies_and_pairs_that_are_clear_where_it_starts(arm):
    limit = limit_of(arm)
    model = model_of(arm)
    assert len(limit.bodies.links) >= 4
    assert len(limit.bodies.pairs(limit.influence)) >= 3
    _, distances, _ = limit.near(model.state(np.array(ARMS[arm].start), np.zeros(model.n)))
    assert (distances > limit.clearance).all()


# --- what they keep -------------------------------------------------------------------------------


def least_distance(limit: CollisionLimit, commands: list[Command]) -> float:
    """Of all that is near in any tick [m]."""
    model = limit.model
    still = np.zeros(model.n)
    found = [limit.near(model.state(command.q_ref, still))[1] for command in commands]
    return min((float(distances.min()) for distances in found if len(distances)), default=np.inf)


def driven(arm: str, dx: np.ndarray, ticks: int, limit: CollisionLimit, names=BOX) -> list[Command]:
    """Commands to an ideal arm that is asked for one task velocity all the time."""
    model = model_of(arm)
    controller = Controller(model, make_law('minimum_acceleration'), T, limits=(*names, limit))
    q = np.array(ARMS[arm].start)
    commands = []
    for _ in range(ticks):
        command = controller.update(q, dx)
        commands.append(command)
        q = command.q_ref
    return commands


def lowest_point(arm: str) -> float:
    """Of the bodies that can do something about it, where the arm starts [m]."""
    model = model_of(arm)
    state = model.state(np.array(ARMS[arm].start), np.zeros(model.n))
    bodies = limit_of(arm).bodies
    return min(
        height_of(bodies, i, state) for i in range(len(bodies.radius)) if bodies.moved_by[i] > 1
    )


@pytest.mark.slow
@EVERY_ARM
def test_no_body_comes_nearer_to_the_floor_than_its_clearance(arm):
    limit = limit_of(arm, floor=lowest_point(arm) - 0.1)
    commands = driven(arm, np.array((0.0, 0.0, -0.3)), 1000, limit)
    assert CLEARANCE - ABOUT < least_distance(limit, commands) < 2.0 * CLEARANCE
    assert any(command.active_limits.endswith(' to floor: collision') for command in commands)


@pytest.mark.slow
@EVERY_ARM
def test_an_arm_that_is_drawn_into_itself_keeps_clear(arm):
    model = model_of(arm)
    x, _ = model.tip(np.array(ARMS[arm].start))
    limit = limit_of(arm)
    inward = -0.3 * x / np.linalg.norm(x)
    commands = driven(arm, inward, 1500, limit)
    assert least_distance(limit, commands) > CLEARANCE - ABOUT
    allowed = np.array(ARMS[arm].acceleration_limit) * (1.0 + 1e-9)
    assert all((np.abs(command.ddq) <= allowed).all() for command in commands)


def random_motion_of(
    arm: str, seed: int, names: tuple[str, ...], *, T: float = T, limit_scale: float = 1.0
) -> tuple[CollisionLimit, list[Command]]:
    """Commands to an ideal arm that is sent in a random direction, or inward, every 0.4 s; it has
    two balls around its start.
    """
    model = model_of(arm)
    random = np.random.default_rng(seed)
    q = np.array(ARMS[arm].start)
    x, _ = model.tip(q)
    spheres = []
    for way in random.normal(size=(2, 3)):
        spheres += [*(x + 0.35 * way / np.linalg.norm(way)), 0.05]
    limit = limit_of(arm, spheres=tuple(spheres))
    controller = Controller(
        model, make_law('minimum_acceleration'), T, limits=(*names, limit), limit_scale=limit_scale
    )
    commands = []
    for _ in range(8):
        way = -model.tip(q)[0] if random.uniform() < 0.5 else random.normal(size=3)
        dx = random.uniform(0.5, 1.5) * way / np.linalg.norm(way)
        for _ in range(round(0.4 / T)):
            commands.append(controller.update(q, dx))
            q = commands[-1].q_ref
    return limit, commands


@pytest.mark.slow
@pytest.mark.parametrize(
    ('arm', 'settings'), by_day(3, product(ARMS, [{}, {'T': 0.01}, {'limit_scale': 0.3}]))
)
def test_random_motion_keeps_the_clearance(arm, settings):
    """At up to 1.5 m/s, where arms that brake by the damper alone come 54 mm too near."""
    for seed in range(2):
        limit, commands = random_motion_of(arm, seed, BOX, **settings)
        if least_distance(limit, commands[:1]) < CLEARANCE:
            continue  # it starts inside
        assert least_distance(limit, commands) > CLEARANCE - ABOUT, seed


@pytest.mark.slow
@pytest.mark.parametrize('arm', by_day(1, ['planar4r', 'fr3', 'gen3']))
def test_without_an_acceleration_limit_the_clearance_is_kept_as_well(arm):
    for seed in range(2):
        limit, commands = random_motion_of(arm, seed, ('position', 'velocity'))
        assert least_distance(limit, commands) > CLEARANCE - ABOUT, seed


@pytest.mark.slow
def test_without_an_acceleration_limit_joints_do_not_swing_beside_a_ball():
    """A swing: a joint goes from one end of its acceleration to the other from tick to tick."""
    arm = 'fr3'
    A = np.array(ARMS[arm].acceleration_limit)
    swings = 0
    acting = 0
    for seed in range(2):
        _, commands = random_motion_of(arm, seed, ('position', 'velocity'))
        for before, after in pairwise(commands):
            if all(command.active_limits.endswith('collision') for command in (before, after)):
                acting += 1
                first = before.ddq / A
                second = after.ddq / A
                least = np.minimum(np.abs(first), np.abs(second))
                swings += ((first * second < 0.0) & (least > 0.9)).any()
    assert acting > 100
    assert swings < 0.1 * acting  # every other tick with rows that leave the acceleration free


def test_a_ball_in_the_way_is_passed_by_no_body():
    arm = 'iiwa7'
    x, _ = model_of(arm).tip(np.array(ARMS[arm].start))
    ball = (float(x[0]), float(x[1]) + 0.25, float(x[2]), 0.05)
    limit = limit_of(arm, spheres=ball)
    commands = driven(arm, np.array((0.0, 0.2, 0.0)), 1000, limit)
    assert least_distance(limit, commands) > CLEARANCE - ABOUT
    assert commands[-1].active_limits.endswith(' to ball 1: collision')


def test_collision_comes_before_torque_and_after_the_box():
    """Pushed into the floor from inside it: out again, as fast as the accelerations allow."""
    arm = 'lwr4'
    model = model_of(arm)
    x, _ = model.tip(np.array(ARMS[arm].start))
    limit = limit_of(arm, floor=float(x[2]))
    limits = make_limits((*BOX, 'torque', limit), model, torque_scale=0.3)
    assert [type(each) for each in limits][-2:] == [CollisionLimit, type(list(limits)[-1])]
    controller = Controller(model, make_law('minimum_velocity'), T, limits=tuple(limits))
    q = np.array(ARMS[arm].start)
    allowed = np.array(ARMS[arm].acceleration_limit) * (1.0 + 1e-9)
    for _ in range(500):
        command = controller.update(q, np.zeros(3))
        assert (np.abs(command.ddq) <= allowed).all()
        q = command.q_ref
    _, distances, _ = limit.near(model.state(q, np.zeros(model.n)))
    assert distances.min() > 0.9 * CLEARANCE


def test_far_from_everything_the_closed_form_comes_back_to_the_bit():
    model = model_of('lwr4')
    q = np.array(ARMS['lwr4'].start)
    dx = np.array((0.0, 0.05, 0.0))
    with_it = Controller(model, make_law('minimum_velocity'), T, limits=('position', 'collision'))
    without = Controller(model, make_law('minimum_velocity'), T)
    assert (with_it.update(q, dx).dq == without.update(q, dx).dq).all()


# --- what is refused ------------------------------------------------------------------------------


def test_balls_come_as_four_numbers_each():
    with pytest.raises(ArrayError, match='spheres holds 3 numbers; expected four for each'):
        limit_of('lwr4', spheres=(0.1, 0.2, 0.3))


def test_an_arm_with_two_tips_is_refused_by_their_names():
    path = Path(__file__).parents[1] / 'examples' / 'two_arms.urdf'
    arm = Arm(path, tip_frame='left_hand', other_tips=('right_hand',))
    with pytest.raises(ArrayError, match='knows arms with one tip; .* has also right_hand'):
        CollisionLimit(RobotModel(arm))


def test_a_clearance_beyond_the_influence_is_refused():
    with pytest.raises(ArrayError, match='expected less than the influence'):
        limit_of('lwr4', clearance=0.2)


def test_no_tick_reads_the_urdf_again(monkeypatch):
    """Reading it takes as long as many ticks: the limit does it when it is made."""
    controller = Controller(
        RobotModel.named('fr3'),
        'minimum_acceleration',
        T,
        limits=(*BOX, 'collision'),
        limit_gains={'collision.influence': 1.0, 'collision.floor': 0.0},
    )
    monkeypatch.setattr(Urdf, 'read', None)
    command = controller.update(np.array(ARMS['fr3'].start), np.array((0.0, 0.0, -10.0)))
    assert command.active_limits
