"""Walls: what they are, and that no point of the arm passes one."""

from itertools import product

import numpy as np
import pytest
from nightly import by_day

from redres_ros import Controller, RobotModel
from redres_ros.errors import ArrayError, UnknownNameError
from redres_ros.limits.workspace import WorkspaceLimit

SHAPES = {
    'half_spaces': (0.0, 0.6, 0.8, 0.5),
    'inside_boxes': (-0.4, -0.5, -0.6, 0.7, 0.8, 0.9),
    'outside_boxes': (0.1, 0.1, 0.1, 0.4, 0.3, 0.2),
    'inside_spheres': (0.0, 0.1, 0.2, 0.9),
    'outside_spheres': (0.5, 0.0, 0.3, 0.2),
}
FARTHEST = 1e3  # [m]: everything is near
T = 0.002  # [s]


def middle_of(model: RobotModel) -> np.ndarray:
    """A posture well within the ranges, (n,) [rad]."""
    lower = np.maximum(model.q_min, -3.0)
    upper = np.minimum(model.q_max, 3.0)
    return (lower + upper) / 2.0 + 0.1 * (upper - lower)


def expected_distances(x: np.ndarray) -> list[float]:
    """Of a point from the walls of SHAPES, in their order, each from its definition."""
    *normal, offset = SHAPES['half_spaces']
    lower, upper = np.reshape(SHAPES['inside_boxes'], (2, 3))
    low, high = np.reshape(SHAPES['outside_boxes'], (2, 3))
    *centre, radius = SHAPES['inside_spheres']
    *middle, size = SHAPES['outside_spheres']
    outside = np.linalg.norm(x - np.clip(x, low, high))
    depth = np.minimum(x - low, high - x).min()
    return [
        offset - float(np.dot(normal, x)),
        *(x - lower),
        *(upper - x),
        outside if outside > 0.0 else -depth,
        radius - np.linalg.norm(x - centre),
        np.linalg.norm(x - middle) - size,
    ]


@pytest.mark.parametrize('name', ['lwr4', 'planar4r'])
def test_distances_are_those_of_the_definition_for_each_point(name):
    model = RobotModel.named(name)
    limit = WorkspaceLimit(model, points='tip, elbow', **SHAPES)
    random = np.random.default_rng(0)
    for _ in range(40):
        q = middle_of(model) + random.uniform(-1.0, 1.0, model.n)
        _, distance, who = limit.approaches(q, FARTHEST)
        points = (model.tip(q)[0], model.position(q, model.elbow_frame))
        expected = np.array([expected_distances(x) for x in points])
        point, wall = who.T
        assert distance == pytest.approx(expected[point, -1 - wall], abs=1e-12)
        assert name == 'planar4r' or len(who) == expected.size  # no joint of that leads up or down


def test_rows_are_the_speeds_at_which_distances_become_smaller():
    model = RobotModel.named('lwr4')
    limit = WorkspaceLimit(model, points='tip,elbow', **SHAPES)
    random = np.random.default_rng(1)
    step = 1e-6  # [rad]
    for _ in range(10):
        q = middle_of(model) + random.uniform(-0.5, 0.5, model.n)
        dq = random.normal(size=model.n)
        C, _, _ = limit.approaches(q, FARTHEST)
        _, after, _ = limit.approaches(q + step * dq, FARTHEST)
        _, before, _ = limit.approaches(q - step * dq, FARTHEST)
        assert C @ dq == pytest.approx((before - after) / (2.0 * step), abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    ('name', 'T'), by_day(2, product(['lwr4', 'fr3', 'planar4r'], [0.002, 0.01]))
)
def test_no_point_passes_a_wall_whatever_is_asked(name, T):
    """In a box with a ball in it, under random velocities far beyond what the joints can do."""
    model = RobotModel.named(name)
    q = middle_of(model)
    x, _ = model.tip(q)
    walls = {
        'inside_boxes': (*(x - 0.2), *(x + 0.2)),
        'outside_spheres': (*(x + np.array((0.1, 0.05, 0.0))), 0.05),
    }
    limit = WorkspaceLimit(model, **walls)
    controller = Controller(
        model,
        'minimum_acceleration',
        T,
        limits=('position', 'velocity', 'acceleration', limit),
    )
    random = np.random.default_rng(2)
    nearest = np.inf
    for k in range(1500):
        if k % round(1.0 / T) == 0:
            dx = random.uniform(-1.0, 1.0, 3)
        q = controller.update(q, dx).q_ref
        nearest = min(nearest, limit.approaches(q, FARTHEST)[1].min())
    assert -1e-9 < nearest < 0.02  # [m]: the walls were reached, and not passed


def test_a_tip_that_moves_fast_along_a_wall_stays_on_its_side():
    """There and back at 1 m/s, while joints turn: in 10 ms they lead 0.1 mm off the tangent."""
    model = RobotModel.named('lwr4')
    q = middle_of(model)
    x, _ = model.tip(q)
    n = np.array((x[0], x[1], 0.0)) / np.hypot(x[0], x[1])
    along = np.array((-n[1], n[0], 0.0))
    limit = WorkspaceLimit(model, half_spaces=(*-n, 0.005 - float(n @ x)))
    controller = Controller(
        model,
        'minimum_velocity',
        0.01,
        limits=('position', 'velocity', 'acceleration', limit),
        scaling='components',
    )
    nearest = np.inf
    for k in range(200):
        turns = np.sign(np.sin(np.pi * k / 40.0 + 0.8))
        q = controller.update(q, turns * along - 0.1 * n).q_ref
        nearest = min(nearest, limit.approaches(q, FARTHEST)[1].min())
    assert -1e-5 < nearest < 3e-3  # [m]


def braking_tips(model: RobotModel, q: np.ndarray, dq: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Where the tip goes if every joint becomes slower by a step in a tick, (ticks, 3) [m]."""
    tips = [model.tip(q)[0]]
    while dq.any():
        dq = np.sign(dq) * np.maximum(np.abs(dq) - step, 0.0)
        q = q + T * dq
        tips.append(model.tip(q)[0])
    return np.array(tips)


@pytest.mark.parametrize('name', ['lwr4', 'fr3', 'gen3'])
def test_a_wall_that_a_braking_arm_passes_and_leaves_again_is_seen(name):
    """Joints come to rest one after the other: the tip turns back, on the right side at the end."""
    model = RobotModel.named(name)
    step = T * 0.2 * np.array(model.arm.acceleration_limit)
    random = np.random.default_rng(3)
    passed = 0
    for _ in range(40):
        q = middle_of(model) + random.uniform(-0.5, 0.5, model.n)
        dq = random.uniform(-1.0, 1.0, model.n)
        tips = braking_tips(model, q, dq, step)
        chord = (tips[-1] - tips[0]) / np.linalg.norm(tips[-1] - tips[0])
        bulge = tips[len(tips) // 2] - tips[0]
        normal = bulge - (bulge @ chord) * chord
        normal /= np.linalg.norm(normal)
        heights = tips @ normal
        wall = heights.max() - 1e-3  # [m]
        if wall < max(heights[0], heights[-1]) + 1e-3:
            continue
        passed += 1
        limit = WorkspaceLimit(
            model, scale=0.2, acceleration_is_limited=True, half_spaces=(*normal, wall)
        )
        C, _, high = limit.rows(model.state(q, dq), T)
        braking = np.sign(dq) * np.maximum(np.abs(dq) - step, 0.0)
        assert (C @ braking > high).any()
    assert passed > 5


def least_of_every_tick(limit: WorkspaceLimit, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
    """The least distance of each pair on the path of joints that move by dq and then brake."""
    q = q + T * dq
    found = [limit.approaches(q, FARTHEST)]
    while dq.any():
        dq = np.sign(dq) * np.maximum(np.abs(dq) - T * limit.A, 0.0)
        q = q + T * dq
        found.append(limit.approaches(q, FARTHEST))
    return np.min([distance for _, distance, _ in found], axis=0)


@pytest.mark.parametrize('name', ['lwr4', 'gen3'])
def test_a_velocity_can_be_kept_if_braking_after_it_passes_no_wall_in_any_tick(name):
    model = RobotModel.named(name)
    random = np.random.default_rng(4)
    verdicts = []
    for _ in range(60):
        q = middle_of(model) + random.uniform(-0.5, 0.5, model.n)
        dq_prev, dq = random.uniform(-0.3, 0.3, (2, model.n)) * model.dq_max
        x, _ = model.tip(q)
        low, high = random.uniform(0.01, 0.15, (2, 3))
        walls = {
            'inside_boxes': (*(x - low), *(x + high)),
            'outside_spheres': (*(x + random.uniform(0.05, 0.1, 3)), 0.04),
        }
        limit = WorkspaceLimit(model, points='tip,elbow', **walls)
        braking = np.sign(dq_prev) * np.maximum(np.abs(dq_prev) - T * limit.A, 0.0)
        allowed = np.minimum(least_of_every_tick(limit, q, braking), 0.0)
        expected = bool((least_of_every_tick(limit, q, dq) >= allowed).all())
        assert limit.can_be_kept(dq, model.state(q, dq_prev), T) is expected
        verdicts.append(expected)
    assert 5 < sum(verdicts) < 55


def random_walls(model: RobotModel, x: np.ndarray, random: np.random.Generator) -> dict:
    """Walls of each kind around a point that none of them excludes."""
    normals = random.normal(size=(3, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    away = random.uniform(0.08, 0.15, (4, 3))
    sides = np.sign(random.normal(size=(4, 3)))
    sizes = random.uniform(0.01, 0.07, (4, 3))
    centres = x + sides * away
    return {
        'half_spaces': tuple(
            np.hstack((normals, normals @ x[:, None] + random.uniform(0.005, 0.03, (3, 1)))).ravel()
        ),
        'outside_boxes': tuple(np.hstack((centres - sizes, centres + sizes))[:2].ravel()),
        'outside_spheres': tuple(np.hstack((centres, sizes[:, :1]))[2:].ravel()),
    }


@pytest.mark.slow
@pytest.mark.parametrize(
    ('name', 'scale', 'seed'), by_day(4, product(['planar4r', 'lwr4', 'gen3'], [1.0, 0.2], [0, 1]))
)
def test_several_walls_are_kept_while_joints_come_to_rest_one_after_the_other(name, scale, seed):
    """With low accelerations the way to rest is long, and passes several walls."""
    model = RobotModel.named(name)
    random = np.random.default_rng(seed)
    q = middle_of(model)
    walls = random_walls(model, model.tip(q)[0], random)
    limit = WorkspaceLimit(model, scale=scale, acceleration_is_limited=True, **walls)
    controller = Controller(
        model,
        'minimum_velocity',
        T,
        limits=('position', 'velocity', 'acceleration', limit),
        limit_scale=scale,
        scaling='components',
    )
    nearest = []
    for k in range(4000):
        if k % 1000 == 0:
            dx = random.uniform(-1.0, 1.0, 3)
        q = controller.update(q, dx).q_ref
        nearest.append(limit.approaches(q, FARTHEST)[1].min())
    assert -1e-9 < min(nearest) < 0.02  # [m]


@pytest.mark.slow
def test_an_arm_outside_comes_back_within_its_limits():
    model = RobotModel.named('lwr4')
    q = middle_of(model)
    x, _ = model.tip(q)
    n = np.array((0.0, 0.0, 1.0))
    limit = WorkspaceLimit(model, half_spaces=(*n, float(x @ n) - 0.05))
    controller = Controller(
        model, 'minimum_velocity', 0.002, limits=('position', 'velocity', 'acceleration', limit)
    )
    for _ in range(3000):
        q = controller.update(q, np.zeros(3)).q_ref
    assert limit.approaches(q, FARTHEST)[1].min() > -1e-3


def test_an_arm_outside_of_one_wall_comes_back_along_another_that_it_touches():
    """It does not pass the second wall for the sake of the first one, and does not hang there."""
    model = RobotModel.named('gen3')
    q = middle_of(model)
    x, _ = model.tip(q)
    limit = WorkspaceLimit(
        model,
        acceleration_is_limited=True,
        half_spaces=(1.0, 0.0, 0.0, x[0] - 0.05, 0.0, 1.0, 0.0, x[1]),
    )
    controller = Controller(
        model, 'minimum_acceleration', 0.01, limits=('position', 'velocity', 'acceleration', limit)
    )
    distances = []
    for _ in range(300):
        q = controller.update(q, np.zeros(3)).q_ref
        distances.append(limit.approaches(q, FARTHEST)[1])
    first, second = np.transpose(distances)
    assert first[-1] > -1e-3
    assert second.min() > -1e-9


@pytest.mark.parametrize(
    ('figures', 'words'),
    [
        ({'half_spaces': (1.0, 0.0)}, 'half_spaces holds 2 numbers; expected 4'),
        ({'inside_boxes': (1.0, 0.0, 0.0, 0.0, 1.0, 1.0)}, 'is not below'),
        ({'influence': 0.01, 'clearance': 0.02}, 'less than the influence'),
    ],
)
def test_walls_that_make_no_sense_are_refused(figures, words):
    with pytest.raises(ArrayError, match=words):
        WorkspaceLimit(RobotModel.named('lwr4'), **figures)


def test_a_point_that_is_no_link_is_refused_with_those_that_are():
    with pytest.raises(UnknownNameError, match='link_4'):
        WorkspaceLimit(RobotModel.named('lwr4'), points='tip,hand')


@pytest.mark.parametrize('size', [1.0, 1e4, 1e9])
def test_without_a_limit_on_velocities_no_task_velocity_takes_for_ever(size):
    model = RobotModel.named('lwr4')
    q = middle_of(model)
    x, _ = model.tip(q)
    limit = WorkspaceLimit(model, inside_boxes=(*(x - 0.1), *(x + 0.1)))
    controller = Controller(model, 'minimum_velocity', T, limits=[limit])
    q = controller.update(q, np.array((size, 0.0, 0.0))).q_ref
    assert limit.approaches(q, FARTHEST)[1].min() > -1e-9
