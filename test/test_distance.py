"""Distances: those of other libraries and of definitions, and that arms keep them."""

from functools import cache
from itertools import pairwise, product
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest
from nightly import by_day

from redres_ros import Command, Controller, RobotModel
from redres_ros.errors import ArrayError, UnknownNameError
from redres_ros.limits import make_limits
from redres_ros.limits.distance import CollisionLimit, DistanceLimit, WorkspaceLimit
from redres_ros.robots import ARMS, Arm
from redres_ros.robots.scene import OBSTACLES, WALLS, read_shapes

T = 0.002  # [s]
BOX = ('position', 'velocity', 'acceleration')
BALLS = ((0.5, 0.2, 0.4, 0.1), (-0.5, 0.0, 0.3, 0.05))
CLEARANCE = 0.02  # [m], the default
FARTHEST = 1e3  # [m]: everything is near
ABOUT = 1e-9  # [m], rounding
EVERY_ARM = pytest.mark.parametrize('arm', ARMS)


@cache
def model_of(arm: str) -> RobotModel:
    return RobotModel.named(arm)


def scene_of(**shapes: object) -> str:
    """A text of shapes: of each kind one, or several."""
    found = []
    for kind, numbers in shapes.items():
        found += [' '.join((kind, *map(repr, row.tolist()))) for row in np.atleast_2d(numbers)]
    return '; '.join(found)


def colliding(arm: str, **obstacles: object) -> CollisionLimit:
    return CollisionLimit(model_of(arm), obstacles=scene_of(**obstacles))


def walled(model: RobotModel, points: str = 'tip', scale: float = 1.0, **walls: object):
    """With walls that points may touch."""
    given = {'walls': scene_of(**walls), 'points': points, 'clearance': 0.0}
    return WorkspaceLimit(model, scale, acceleration_is_limited=True, **given)


def start_of(model: RobotModel) -> np.ndarray:
    return np.array(model.arm.start)


def middle_of(model: RobotModel) -> np.ndarray:
    """A posture well within the ranges, (n,) [rad]."""
    lower = np.maximum(model.q_min, -3.0)
    upper = np.minimum(model.q_max, 3.0)
    return (lower + upper) / 2.0 + 0.1 * (upper - lower)


def random_postures(arm: str) -> np.ndarray:
    model = model_of(arm)
    random = np.random.default_rng(0)
    lower, upper = np.maximum(model.q_min, -3.0), np.minimum(model.q_max, 3.0)
    return random.uniform(lower, upper, (20, model.n))


def placed(limit: CollisionLimit, q: np.ndarray, body: int) -> tuple[np.ndarray, float]:
    """The ends of a body's axis, (2, 3) [m], by Pinocchio, and its radius."""
    bodies = limit.model.bodies
    if body >= len(bodies.links):
        *centre, radius = BALLS[body - len(bodies.links)]
        return np.array((centre, centre)), radius
    model = limit.model._model
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    H = data.oMi[int(bodies.moved_by[body])]
    return np.array([H.act(end) for end in bodies.ends[body]]), float(bodies.radius[body])


def shape_of(ends: np.ndarray, radius: float) -> tuple[coal.CollisionGeometry, coal.Transform3s]:
    """A capsule, or a sphere, in the other library."""
    along = ends[1] - ends[0]
    length = float(np.linalg.norm(along))
    turn = np.eye(3)
    if length:
        turn = pin.Quaternion.FromTwoVectors(np.array((0.0, 0.0, 1.0)), along).matrix()
    return coal.Capsule(radius, length), coal.Transform3s(turn, ends.mean(axis=0))


@EVERY_ARM
def test_distances_of_bodies_are_those_of_another_library_and_of_the_floor(arm):
    limit = colliding(arm, floor=-0.3, sphere=BALLS)
    compared = 0
    for q in random_postures(arm):
        _, distances, who = limit.approaches(q, 1.0)
        pairs = limit._scene.pairs[who].tolist()
        for distance, (one, other) in zip(distances, pairs, strict=True):
            first = placed(limit, q, one)
            if other < 0:
                height = first[0][:, 2].min() - first[1] + 0.3
                assert distance == pytest.approx(height, abs=1e-12)
            elif distance > 0.01:  # what touches has other measures
                request = coal.DistanceRequest(), coal.DistanceResult()
                second = placed(limit, q, other)
                theirs = coal.distance(*shape_of(*first), *shape_of(*second), *request)
                assert distance == pytest.approx(theirs, abs=1e-9)
                compared += 1
    assert compared > 50


@EVERY_ARM
def test_an_arm_has_pairs_that_are_clear_where_it_starts_and_none_that_nothing_moves(arm):
    limit = colliding(arm, floor=0.0, sphere=BALLS)
    assert len(limit.model.bodies.links) >= 4
    assert len(limit.model.bodies.pairs(limit.influence)) >= 3
    _, distances, _ = colliding(arm).approaches(start_of(limit.model), FARTHEST)
    assert (distances > CLEARANCE).all()
    fixed = limit._scene.bodies['moved_by'] < 0
    one, other = limit._scene.pairs.T
    assert not (fixed[one] & ((other < 0) | fixed[other])).any()


SHAPES = {
    'half_space': (0.0, 1.2, 1.6, 1.0),  # of a normal that is no unit vector
    'inside_box': (-0.4, -0.5, -0.6, 0.7, 0.8, 0.9),
    'outside_box': (0.1, 0.1, 0.1, 0.4, 0.3, 0.2),
    'inside_sphere': (0.0, 0.1, 0.2, 0.9),
    'outside_sphere': (0.5, 0.0, 0.3, 0.2),
}


def expected_distances(x: np.ndarray) -> list[float]:
    """Of a point from the walls of SHAPES, in their order, each from its definition."""
    lower, upper = np.reshape(SHAPES['inside_box'], (2, 3))
    low, high = np.reshape(SHAPES['outside_box'], (2, 3))
    *centre, radius = SHAPES['inside_sphere']
    *middle, size = SHAPES['outside_sphere']
    outside = np.linalg.norm(x - np.clip(x, low, high))
    depth = np.minimum(x - low, high - x).min()
    return [
        0.5 - float(np.dot((0.0, 0.6, 0.8), x)),
        *(x - lower),
        *(upper - x),
        outside if outside > 0.0 else -depth,
        radius - np.linalg.norm(x - centre),
        np.linalg.norm(x - middle) - size,
    ]


@pytest.mark.parametrize('name', ['lwr4', 'planar4r'])
def test_distances_from_walls_are_those_of_the_definition_for_each_point(name):
    model = model_of(name)
    limit = walled(model, 'tip, elbow', **SHAPES)
    random = np.random.default_rng(0)
    for _ in range(40):
        q = middle_of(model) + random.uniform(-1.0, 1.0, model.n)
        _, distance, who = limit.approaches(q, FARTHEST)
        points = (model.tip(q)[0], model.position(q, model.elbow_frame))
        expected = np.array([expected_distances(x) for x in points])
        point, wall = limit._scene.pairs[who].T
        assert distance == pytest.approx(expected[point, -1 - wall], abs=1e-12)
        assert name == 'planar4r' or len(who) == expected.size  # no joint of that leads up or down


@EVERY_ARM
@pytest.mark.parametrize('kind', ['collision', 'workspace'])
def test_rows_are_the_speeds_at_which_distances_become_smaller(arm, kind):
    """Against central differences; if bodies in line change their nearest points, none exist."""
    model = model_of(arm)
    limit = colliding(arm, floor=0.0, sphere=BALLS)
    if kind == 'workspace':
        limit = walled(model, **SHAPES)
    random = np.random.default_rng(1)
    step = 1e-6
    off = []
    for q in random_postures(arm):
        dq = random.normal(size=model.n)
        C, _, who = limit.approaches(q, 1.0)
        _, after, who_after = limit.approaches(q + step * dq, 1.0)
        _, before, who_before = limit.approaches(q - step * dq, 1.0)
        if who.tolist() == who_after.tolist() == who_before.tolist():
            off.extend(np.abs(C @ dq + (after - before) / (2.0 * step)))
    assert len(off) > 50
    assert np.quantile(off, 0.99) < 1e-6


def joints_on_path(limit: DistanceLimit, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
    """Where joints are, (ticks, n) [rad], that move by dq and then brake."""
    steps = T * limit.A
    ticks = np.arange(2.0 + (np.abs(dq) / steps).max())[:, None]
    return q + T * np.cumsum(np.sign(dq) * np.maximum(np.abs(dq) - steps * ticks, 0.0), axis=0)


def least_of_every_tick(limit: DistanceLimit, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
    """The least distance of each pair on the path of joints that move by dq and then brake."""
    path = joints_on_path(limit, q, dq)
    return np.min([limit.approaches(at, FARTHEST)[1] for at in path], axis=0)


def braked(limit: DistanceLimit, dq: np.ndarray) -> np.ndarray:
    return np.sign(dq) * np.maximum(np.abs(dq) - T * limit.A, 0.0)


@pytest.mark.parametrize('name', ['lwr4', 'gen3'])
def test_a_velocity_can_be_kept_if_braking_after_it_passes_no_wall_in_any_tick(name):
    model = model_of(name)
    random = np.random.default_rng(4)
    verdicts = []
    for _ in range(60):
        q = middle_of(model) + random.uniform(-0.5, 0.5, model.n)
        dq_prev, dq = random.uniform(-0.3, 0.3, (2, model.n)) * model.dq_max
        x, _ = model.tip(q)
        low, high = random.uniform(0.01, 0.15, (2, 3))
        ball = (*(x + random.uniform(0.05, 0.1, 3)), 0.04)
        box = (*(x - low), *(x + high))
        limit = walled(model, 'tip,elbow', inside_box=box, outside_sphere=ball)
        allowed = np.minimum(least_of_every_tick(limit, q, braked(limit, dq_prev)), 0.0)
        expected = bool((least_of_every_tick(limit, q, dq) >= allowed).all())
        assert limit.can_be_kept(dq, model.state(q, dq_prev), T) is expected
        verdicts.append(expected)
    assert 5 < sum(verdicts) < 55


@pytest.mark.parametrize('name', ['planar4r', 'lwr4', 'fr3', 'gen3'])
def test_a_wall_that_a_braking_arm_passes_is_seen_from_afar_and_also_if_it_is_left_again(name):
    """Joints come to rest one after the other: the tip turns back, on the right side at the end."""
    model = model_of(name)
    random = np.random.default_rng(3)
    passed = np.zeros(2, int)
    for _ in range(40):
        q = middle_of(model) + random.uniform(-0.5, 0.5, model.n)
        dq = random.uniform(-1.0, 1.0, model.n)
        limit = walled(model, scale=0.2)
        faster = dq + T * limit.A * np.sign(dq)
        *path, rest = joints_on_path(limit, q, braked(limit, dq))
        tips = np.array([model.tip(at)[0] for at in (q, *path[::4], rest)])
        end, _ = model.tip(joints_on_path(limit, q, faster)[-1])
        chord = (tips[-1] - tips[0]) / np.linalg.norm(tips[-1] - tips[0])
        bulge = tips[len(tips) // 2] - tips[0]
        normal = bulge - (bulge @ chord) * chord
        normal /= np.linalg.norm(normal)
        for n in (normal, chord):
            heights = tips @ n
            wall = heights.max() - 1e-3  # [m]
            is_bulge = n is normal and wall > max(heights[0], heights[-1]) + 1e-3
            is_far = n is chord and wall > heights[0] + limit.influence
            if not is_bulge and not is_far:
                continue
            passed += [is_bulge, is_far]
            hit = walled(model, scale=0.2, half_space=(*n, wall))
            C, _, high = hit.rows(model.state(q, dq), T)
            assert (C @ braked(hit, dq) > high).any()
        beside = walled(model, scale=0.2, half_space=(*chord, (tips[-1] + end) @ chord / 2.0))
        if end @ chord > heights.max():
            C, _, high = beside.rows(model.state(q, dq), T)
            assert (C @ faster > high).any()
    assert (passed > (5, 0)).all()


def driven(
    limit: DistanceLimit,
    asked: list[np.ndarray],
    ticks: int,
    names: tuple[str, ...] = BOX,
    T: float = T,
    **options: object,
) -> list[Command]:
    """Commands to an ideal arm that starts in the middle, or with bodies at its start; each task
    velocity holds for as many ticks.
    """
    model = limit.model
    law = options.pop('law', 'minimum_acceleration')
    controller = Controller(model, law, T, limits=(*names, limit), **options)
    q = start_of(model) if isinstance(limit, CollisionLimit) else middle_of(model)
    commands = []
    for dx in asked:
        for _ in range(ticks):
            commands.append(controller.update(q, dx))
            q = commands[-1].q_ref
    return commands


def least_distance(limit: DistanceLimit, commands: list[Command]) -> float:
    """Of all pairs in any tick [m]."""
    found = [limit.approaches(command.q_ref, FARTHEST)[1] for command in commands]
    return min(float(distances.min()) for distances in found)


def random_directions(limit: CollisionLimit, random: np.random.Generator) -> list[np.ndarray]:
    """Fast task velocities in random directions, or inward."""
    x, _ = limit.model.tip(start_of(limit.model))
    directions = [-x if random.uniform() < 0.5 else random.normal(size=3) for _ in range(8)]
    return [random.uniform(0.5, 1.5) * each / np.linalg.norm(each) for each in directions]


def between_balls(arm: str, random: np.random.Generator) -> CollisionLimit:
    x, _ = model_of(arm).tip(start_of(model_of(arm)))
    directions = random.normal(size=(2, 3))
    centres = x + 0.35 * directions / np.linalg.norm(directions, axis=1)[:, None]
    return colliding(arm, sphere=np.column_stack((centres, np.full(2, 0.05))))


@pytest.mark.slow
@pytest.mark.parametrize(
    ('arm', 'settings'),
    by_day(
        4,
        product(ARMS, [{}, {'T': 0.01}, {'limit_scale': 0.3}, {'names': ('position', 'velocity')}]),
    ),
)
def test_random_motion_keeps_the_clearance(arm, settings):
    """At up to 1.5 m/s, where arms that brake by the damper alone come 54 mm too near."""
    for seed in range(2):
        random = np.random.default_rng(seed)
        limit = between_balls(arm, random)
        ticks = round(0.4 / settings.get('T', T))
        commands = driven(limit, random_directions(limit, random), ticks, **settings)
        if least_distance(limit, commands[:1]) < CLEARANCE:
            continue  # it starts inside
        assert least_distance(limit, commands) > CLEARANCE - ABOUT, seed


def test_without_an_acceleration_limit_joints_do_not_swing_beside_a_ball():
    """A swing: a joint goes from one end of its acceleration to the other from tick to tick."""
    A = np.array(ARMS['fr3'].acceleration_limit)
    random = np.random.default_rng(2)
    limit = between_balls('fr3', random)
    asked = random_directions(limit, random)
    swings = 0
    acting = 0
    for before, after in pairwise(driven(limit, asked, 200, ('position', 'velocity'))):
        if all(command.active_limits.endswith('collision') for command in (before, after)):
            acting += 1
            least = np.minimum(np.abs(before.ddq / A), np.abs(after.ddq / A))
            swings += ((before.ddq * after.ddq < 0.0) & (least > 0.9)).any()
    assert acting > 500
    assert swings < 0.1 * acting  # every other tick with rows that leave the acceleration free


@pytest.mark.parametrize('kind', ['floor', 'sphere'])
def test_an_obstacle_in_the_way_is_approached_and_named_but_not_touched(kind):
    model = model_of('iiwa7')
    x, _ = model.tip(start_of(model))
    limit = colliding('iiwa7', floor=x[2] - 0.1)
    dx = np.array((0.0, 0.0, -0.2))
    if kind == 'sphere':
        limit = colliding('iiwa7', sphere=((5.0, 0.0, 0.0, 0.1), (x[0], x[1] + 0.25, x[2], 0.05)))
        dx = np.array((0.0, 0.2, 0.0))
    at_rest = model.state(start_of(model), np.zeros(7))
    assert not limit.rows(at_rest, T)[0].size  # nothing that this tick could bring too near
    commands = driven(limit, [dx], 1000)
    assert CLEARANCE - ABOUT < least_distance(limit, commands) < 2.0 * CLEARANCE
    expected = {'floor': ' to floor: collision', 'sphere': ' to sphere 2: collision'}[kind]
    assert commands[-1].active_limits.endswith(expected)


def test_a_soft_stop_brakes_harder_beside_an_obstacle():
    """It would take two seconds, and 20 cm."""
    model = model_of('iiwa7')
    q = start_of(model)
    x, _ = model.tip(q)
    limit = colliding('iiwa7', sphere=(x[0], x[1] + 0.25, x[2], 0.05))
    controller = Controller(model, 'minimum_acceleration', T, limits=(*BOX, limit), switch_time=2.0)
    commands = []
    for k in range(1200):
        if k == 640:
            controller.hold()
        commands.append(controller.update(q, np.array((0.0, 0.2, 0.0))))
        q = commands[-1].q_ref
    assert CLEARANCE - ABOUT < least_distance(limit, commands) < 3.0 * CLEARANCE


@pytest.mark.slow
@pytest.mark.parametrize(
    ('name', 'scale', 'seed'), by_day(4, product(['planar4r', 'lwr4', 'gen3'], [1.0, 0.2], [0, 1]))
)
def test_no_point_passes_a_wall_while_joints_come_to_rest_one_after_the_other(name, scale, seed):
    """Walls of each kind around the tip. With low accelerations it takes long to rest."""
    model = model_of(name)
    random = np.random.default_rng(seed)
    x, _ = model.tip(middle_of(model))
    normal = random.normal(size=3)
    normal /= np.linalg.norm(normal)
    sides = np.sign(random.normal(size=(2, 3))) * random.uniform(0.08, 0.15, (2, 3))
    sizes = random.uniform(0.01, 0.07, 3)
    limit = walled(
        model,
        scale=scale,
        half_space=(*normal, float(normal @ x) + 0.02),
        inside_box=(*(x - 0.2), *(x + 0.2)),
        outside_box=(*(x + sides[0] - sizes), *(x + sides[0] + sizes)),
        outside_sphere=(*(x + sides[1]), sizes[0]),
    )
    asked = [random.uniform(-1.0, 1.0, 3) for _ in range(4)]
    options = {'limit_scale': scale, 'scaling': ('task', 'components')[seed]}
    commands = driven(limit, asked, 500, law='minimum_velocity', **options)
    assert -1e-9 < least_distance(limit, commands) < 0.05  # [m]: reached, and not passed


def test_an_arm_inside_an_obstacle_comes_out_before_torque_and_after_the_box():
    arm = 'lwr4'
    model = model_of(arm)
    x, _ = model.tip(start_of(model))
    limit = colliding(arm, floor=x[2])
    limits = make_limits((*BOX, 'torque', limit), model, torque_scale=0.3)
    assert [limits.names[each] for each in limits][-2:] == ['collision', 'torque']
    commands = driven(limit, [np.zeros(3)], 500, (*BOX, 'torque'), torque_scale=0.3)
    allowed = np.array(ARMS[arm].acceleration_limit) * (1.0 + 1e-9)
    assert all((np.abs(command.ddq) <= allowed).all() for command in commands)
    assert least_distance(limit, commands[-1:]) > 0.9 * CLEARANCE


@pytest.mark.parametrize(('task', 'scaling'), [('position', 'task'), ('pose', 'components')])
@pytest.mark.parametrize('name', ['fr3', 'iiwa7'])
def test_an_arm_that_is_led_into_a_wall_does_not_swing(name, task, scaling):
    """The largest s is not bought with null-space motion that turns in every tick."""
    model = model_of(name)
    x, _ = model.tip(middle_of(model))
    limit = walled(model, half_space=(0.0, 0.0, -1.0, 0.1 - x[2]))
    dx = np.array((0.05, 0.0, -0.2, 0.3, 0.0, 0.2))[: 3 if task == 'position' else 6]
    ddq = [command.ddq for command in driven(limit, [dx], 1500, task=task, scaling=scaling)]
    swings = np.abs(np.diff(ddq, axis=0)) > 0.5 * np.array(model.arm.acceleration_limit)
    assert np.count_nonzero(swings.any(axis=1)) < 10


def test_an_arm_outside_of_one_wall_comes_back_along_another_that_it_touches():
    """It does not pass the second wall for the sake of the first one, and does not hang there."""
    model = model_of('gen3')
    x, _ = model.tip(middle_of(model))
    limit = walled(model, half_space=((0.0, 1.0, 0.0, x[1]), (1.0, 0.0, 0.0, x[0] - 0.05)))
    commands = driven(limit, [np.zeros(3)], 300, T=0.01)
    distances = [limit.approaches(command.q_ref, FARTHEST)[1] for command in commands]
    second, first = np.transpose(distances)
    assert first[-1] > -1e-3
    assert second.min() > -1e-9
    assert 'tool0 to half space 2: workspace' in {each.active_limits for each in commands}


@pytest.mark.parametrize('size', [1.0, 1e9])
def test_without_a_limit_on_velocities_no_task_velocity_takes_for_ever(size):
    model = model_of('lwr4')
    x, _ = model.tip(middle_of(model))
    limit = WorkspaceLimit(model, walls=scene_of(inside_box=(*(x - 0.1), *(x + 0.1))))
    commands = driven(limit, [np.array((size, 0.0, 0.0))], 1, (), law='minimum_velocity')
    assert least_distance(limit, commands) > -1e-9


@pytest.mark.parametrize(
    ('kinds', 'text'),
    [
        (OBSTACLES, 'sphere 0.1 0.2 0.3'),
        (OBSTACLES, 'floor low'),
        (OBSTACLES, 'floor nan'),
        (OBSTACLES, 'floor 101'),
        (OBSTACLES, 'floor 0; half_space 0 0 1 1'),
        (WALLS, 'outside_sphere 0 0 0 0'),
        (WALLS, 'half_space 0 0 0 1'),
        (WALLS, 'inside_box 1 0 0 0 1 1'),
    ],
)
def test_shapes_that_make_no_sense_are_refused(kinds, text):
    with pytest.raises(ArrayError):
        read_shapes(text, kinds)


def test_a_point_that_is_no_link_is_refused_with_those_that_are():
    with pytest.raises(UnknownNameError, match='link_4'):
        WorkspaceLimit(RobotModel.named('lwr4'), points='tip,hand')


def test_an_arm_with_two_tips_is_refused_by_their_names():
    path = Path(__file__).parents[1] / 'examples' / 'two_arms.urdf'
    arm = Arm(path, tip_frame='left_hand', other_tips=('right_hand',))
    with pytest.raises(ArrayError, match='knows arms with one tip; .* has also right_hand'):
        CollisionLimit(RobotModel(arm))
