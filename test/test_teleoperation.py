"""Simulated operators, and what the benchmark measures of an arm under them."""

import json
from pathlib import Path

import numpy as np
import pytest

from redres_ros import RobotModel
from redres_ros.bench import peers, teleoperation
from redres_ros.bench.teleoperation import T, figures_of, make_operator, steered
from redres_ros.cli import main
from redres_ros.robot_model import RobotState
from redres_ros.simulation.operators import SPEED, TURN, BlindOperator


@pytest.fixture
def fr3() -> RobotModel:
    return RobotModel.named('fr3')


def nobody(done: float) -> None:
    pass


def test_a_twist_is_smooth_and_within_the_joysticks_range():
    operator = BlindOperator(T, 1)
    twists = np.array([operator.twist(k * T, np.zeros(3), np.eye(3)) for k in range(5000)])
    assert np.linalg.norm(twists[:, :3], axis=1).max() <= SPEED
    assert np.linalg.norm(twists[:, 3:], axis=1).max() <= TURN
    assert np.abs(np.diff(twists[:, :3], axis=0)).max() <= 2.0 * SPEED * T / 0.1
    assert np.std(twists[:, 0]) > 0.1 * SPEED


def test_the_same_seed_asks_for_the_same(fr3):
    first, second = (make_operator('goal', fr3, 3) for _ in range(2))
    other = make_operator('goal', fr3, 4)
    assert (first.goal.x == second.goal.x).all()
    assert (first.goal.x != other.goal.x).any()


def test_an_arm_that_does_not_move_is_stuck_and_its_goals_are_given_up(fr3):
    operator = make_operator('goal', fr3, 0)
    motion = steered(operator, fr3, lambda q, dq, dx: q, 16.0, nobody)
    figures = figures_of(motion, fr3, operator)
    assert figures.stuck > 0.9
    assert figures.longest_stuck > 10.0
    assert figures.moving == 0.0
    assert (figures.reached, figures.given_up) == (0, 1)


def test_an_arm_that_executes_every_twist_reaches_its_goals(fr3):
    """By the pseudoinverse, without limits."""

    def follow(q: np.ndarray, dq: np.ndarray, dx: np.ndarray) -> np.ndarray:
        J = RobotState(fr3, q, dq).J
        return q + T * J.T @ np.linalg.solve(J @ J.T + 1e-4 * np.eye(6), dx)

    operator = make_operator('goal', fr3, 0)
    motion = steered(operator, fr3, follow, 12.0, nobody)
    figures = figures_of(motion, fr3, operator)
    assert figures.reached >= 1
    assert figures.moving > 0.9


@pytest.mark.parametrize('name', ['embodik', 'pink', 'mink'])
def test_a_peer_follows_a_twist_where_no_limit_acts(name, fr3):
    if name not in peers.twist_peers():
        pytest.skip(f'{name} is not installed')
    follow = peers.twist_peers()[name](fr3.arm, T)
    dx = np.array((0.02, 0.05, -0.03, 0.1, 0.2, -0.1))
    q = np.array(fr3.arm.start)
    dq = np.zeros(7)
    for _ in range(50):
        before = q
        q = follow(q, dq, dx)
        dq = (q - before) / T
    assert np.abs(RobotState(fr3, before, dq).J @ dq - dx).max() < 5e-3  # of its damping


def test_the_bench_writes_what_it_prints(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(teleoperation, 'ARMS', ('fr3',))
    options = ['--only', 'teleoperation', '--duration', '0.01', '--out', str(tmp_path)]
    assert main(['bench', *options]) == 0
    content = json.loads((tmp_path / 'bench.json').read_text())['teleoperation']
    names = (*teleoperation.OURS, *peers.twist_peers())
    assert set(content['runs']) == {
        f'{operator}, fr3, {name}' for operator in teleoperation.OPERATORS for name in names
    }
