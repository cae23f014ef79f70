"""Kinematics and dynamics: against the paper's numbers, finite differences, MuJoCo and a derivation
of their own.
"""

import pickle
import xml.etree.ElementTree as ET
from collections.abc import Callable
from copy import copy, deepcopy
from dataclasses import replace
from pathlib import Path

import independent
import numpy as np
import pytest
from doubles import random_motion

from redres_ros import Controller, RobotModel
from redres_ros.errors import ArrayError, RangeError, UnknownNameError
from redres_ros.robots import ARMS, Arm, arm_from_urdf, find_arm
from redres_ros.robots.arm import DYNAMICS

AGREEMENT = 1e-9  # two libraries in double precision, numbers up to some hundreds
QUANTITIES = ('q', 'dq_prev', 'x', 'R', 'J', 'M', 'n')  # of a state
BOTH_LWR = pytest.mark.parametrize('name', ['lwr4', 'lwr4_paper'])  # others: test_arms.py
EVERY_DYNAMICS = pytest.mark.parametrize('dynamics', DYNAMICS)


def test_the_start_of_the_paper_is_at_its_first_point(model):
    # q(0) is given to 0.01 degrees
    assert np.linalg.norm(model.tip(independent.Q0)[0] - independent.POINTS[0]) < 0.2e-3


def test_at_another_velocity_a_state_keeps_what_the_position_decides(model):
    q, dq = random_motion(7, 1)[0]
    state = model.state(q, dq)
    for name in QUANTITIES:
        getattr(state, name)
    other = state.with_velocity(-2.0 * dq)
    expected = model.state(q, -2.0 * dq)
    assert other.J is state.J
    assert other.M is state.M
    assert all((getattr(other, name) == getattr(expected, name)).all() for name in QUANTITIES)


def test_the_position_of_a_frame_is_in_the_base_frame(model):
    q, _ = random_motion(7, 1)[0]
    assert (model.position(q, 'tool0') == model.tip(q)[0]).all()
    assert model.position(q, 'link_2') == pytest.approx((0.0, 0.0, 0.323), abs=1e-12)
    elbow = model.position(q, model.arm.elbow_frame) - (0.0, 0.0, 0.323)
    assert np.linalg.norm(elbow) == pytest.approx(0.4)


def urdf_links(d: np.ndarray) -> independent.Links:
    """The LWR's inertias as its URDF states them."""
    inertials = [
        ET.fromstring(ARMS['lwr4'].urdf).find(f"link[@name='link_{i}']/inertial")
        for i in range(1, 8)
    ]
    mass = np.array([float(inertial.find('mass').get('value')) for inertial in inertials])
    com = np.array(
        [inertial.find('origin').get('xyz').split() for inertial in inertials], dtype=float
    )
    inertia = np.array(
        [
            np.diag([float(inertial.find('inertia').get(axis)) for axis in ('ixx', 'iyy', 'izz')])
            for inertial in inertials
        ]
    )
    return independent.Links(d, mass, com, inertia, np.array(ARMS['lwr4'].rotor_inertia))


@BOTH_LWR
@EVERY_DYNAMICS
def test_a_derivation_of_its_own_agrees(name, dynamics):
    d = {'lwr4': independent.BARE, 'lwr4_paper': independent.PAPER}[name]
    links = independent.cylinders(d) if dynamics == 'cylinders' else urdf_links(d)
    model = RobotModel.named(name, dynamics=dynamics)
    motion = random_motion(7, 100, seed=1)
    expected = independent.evaluate(links, *map(np.array, zip(*motion, strict=True)))
    for row, (q, dq) in enumerate(motion):
        state = model.state(q, dq)
        for got, array in zip((state.x, state.J[:3], state.M, state.n), expected, strict=True):
            assert np.abs(got - array[row]).max() < AGREEMENT


def gravity_moment(**joints: float) -> np.ndarray:
    """Gravity torques of the bare LWR per g, (7,), that is first moments [kg m]; joints not given
    [deg] are at 0.
    """
    q = np.radians([joints.get(f'q{i}', 0.0) for i in range(1, 8)])
    return np.abs(RobotModel.named('lwr4').state(q, np.zeros(7)).n) / 9.81


@pytest.mark.parametrize(
    ('joint', 'moment', 'digit', 'pose'),
    [
        (
            2,
            3.37,
            0.01,
            {'q2': 90.0, 'q4': 90.0},
        ),  # upper arm horizontal, the rest hanging from the elbow
        (4, 1.37, 0.01, {'q4': 90.0, 'q6': 90.0}),  # forearm horizontal, hand hanging
        (5, 0.049, 0.001, {'q4': 90.0}),  # forearm horizontal, about its own axis
        (6, 0.042, 0.001, {'q6': 90.0}),  # hand horizontal
    ],
)
def test_first_moments_are_those_identified(joint, moment, digit, pose):
    assert gravity_moment(**pose)[joint - 1] == pytest.approx(moment, abs=digit / 2)


def test_rotors_add_what_was_identified_and_couple_nothing():
    q, dq = random_motion(7, 1)[0]
    bare = replace(ARMS['lwr4'], rotor_inertia=())
    added = RobotModel.named('lwr4').state(q, dq).M - RobotModel(bare).state(q, dq).M
    assert np.diag(added)[2:] == pytest.approx((2.01, 1.92, 0.776, 0.391, 0.399), abs=1e-12)
    assert added == pytest.approx(np.diag(np.diag(added)), abs=1e-12)


def test_no_later_call_overwrites_a_state(model):
    q, dq = random_motion(7, 1)[0]
    state = model.state(q, dq)
    held = [getattr(state, name) for name in QUANTITIES]
    before = [array.copy() for array in held]
    for other, velocity in random_motion(7, 3, seed=1):
        model.state(other, velocity)
        model.tip(other)
        model.position(other, 'link_4')
    assert all((array == then).all() for array, then in zip(held, before, strict=True))
    for name, then in zip(QUANTITIES, before, strict=True):
        assert (getattr(state, name) == then).all()


BAD_VECTORS = [
    np.zeros(6),
    np.zeros((7, 1)),
    np.float64(0.0),
    np.array([0, 0, np.nan, 0, 0, 0, 0]),
    np.full(7, np.inf),
]


@pytest.mark.parametrize('bad', BAD_VECTORS, ids=['short', 'column', 'scalar', 'nan', 'inf'])
@pytest.mark.parametrize('name', ['q', 'dq_prev'])
def test_a_vector_of_another_shape_or_not_finite_is_refused_by_name(model, name, bad):
    arguments = {'q': np.zeros(7), 'dq_prev': np.zeros(7)} | {name: bad}
    with pytest.raises(ArrayError, match=f'^{name} '):
        model.state(**arguments)


def test_an_unknown_robot_or_frame_is_refused_with_those_that_exist(model):
    with pytest.raises(UnknownNameError, match='allowed: fr3, gen3, iiwa7, lwr4'):
        RobotModel.named('iiwa')
    with pytest.raises(UnknownNameError, match='allowed: .*tool0'):
        model.position(np.zeros(7), 'hand')
    with pytest.raises(UnknownNameError, match='hand'):
        RobotModel(replace(ARMS['lwr4'], tip_frame='hand'))


@pytest.mark.parametrize('offset', [np.nan, 2.1, -np.inf])
@pytest.mark.parametrize('which', ['base_offset', 'tool_offset'])
def test_an_offset_out_of_range_is_refused_by_name(which, offset):
    with pytest.raises(RangeError, match=f'{which} is {offset}; allowed: -2 to 2'):
        find_arm('lwr4', **{which: offset})


def test_joints_come_in_the_order_of_the_arm_with_their_limits(model):
    axes = ('a1', 'a2', 'e1', 'a3', 'a4', 'a5', 'a6')
    assert model.joint_names == tuple(f'lwr_{axis}_joint' for axis in axes)
    assert model.q_max == pytest.approx(np.radians((170, 120, 170, 120, 170, 120, 170)))
    assert model.q_min == pytest.approx(-model.q_max)
    assert model.dq_max == pytest.approx(np.radians((120, 120, 160, 160, 250, 220, 220)))


def pickled(original: object) -> object:
    return pickle.loads(pickle.dumps(original))


EVERY_COPY = pytest.mark.parametrize('copied', [pickled, copy, deepcopy])


def models(tmp_path: Path) -> list[RobotModel]:
    """From every source that a model may have."""
    urdf = ARMS['iiwa7'].urdf
    path = tmp_path / 'my_arm.urdf'
    path.write_text(urdf)
    two_tips = Path(__file__).parents[1] / 'examples' / 'two_arms.urdf'
    made = [RobotModel.named(name) for name in ARMS]
    made += [
        RobotModel.named('lwr4_paper', dynamics='cylinders', base_offset=0.1, tool_offset=0.2),
        RobotModel(find_arm('fr3', tip_frame='fr3_link5')),
        RobotModel.from_urdf(path, 'tool0', effort_limit=(30.0,) * 7),
        RobotModel(arm_from_urdf(urdf, 'tool0')),
        RobotModel(Arm(two_tips, tip_frame='left_hand', other_tips=('right_hand',))),
    ]
    path.unlink()  # a copy may be made where the file is not
    return made


def test_the_limits_of_a_model_cannot_be_changed_by_what_is_done_to_them(model):
    for limit in (model.q_min, model.q_max, model.dq_max, model.tau_max):
        with pytest.raises(ValueError, match='read-only'):
            limit[:] = 9.0


@EVERY_COPY
def test_a_copy_of_a_model_is_the_same_arm(copied: Callable, tmp_path: Path) -> None:
    for model in models(tmp_path):
        for name in ('q_min', 'q_max', 'dq_max', 'tau_max'):
            assert (getattr(copied(model), name) == getattr(model, name)).all()
        other = copied(model)
        assert other.joint_names == model.joint_names
        for q, dq in random_motion(model.n, 3):
            expected = model.state(q, dq)
            state = other.state(q, dq)
            for name in QUANTITIES:
                assert (getattr(state, name) == getattr(expected, name)).all()


def test_a_copy_and_its_original_share_no_data(model: RobotModel) -> None:
    other = copy(model)
    (q, _), (q_other, _) = random_motion(model.n, 2)
    state = model.state(q, q)
    x = state.x
    assert np.isfinite(other.state(q_other, q).J).all()
    assert (state.R == model.tip(q)[1]).all()
    assert (x == model.tip(q)[0]).all()


@pytest.mark.parametrize('copied', [pickled, deepcopy])
def test_a_copied_controller_goes_on_as_the_original(copied: Callable) -> None:
    model = RobotModel.named('fr3')
    controller = Controller(
        model,
        'minimum_weighted_torque',
        0.002,
        switch_time=0.02,
        limits=('position', 'velocity', 'acceleration', 'torque', 'collision'),
        preferences=('posture',),
        secondary_tasks=('orientation',),
    )
    dx = np.array((0.1, 0.3, -0.2))
    q = np.array(model.arm.start)
    for _ in range(30):  # before the start, in the crossfade, after it
        other = copied(controller)
        expected = controller.update(q, dx)
        assert (other.update(q, dx).dq == expected.dq).all()
        q = expected.q_ref
