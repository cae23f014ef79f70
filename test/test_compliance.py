"""An elbow that yields to a push while the tip keeps its force, and comes back."""

import numpy as np
import pytest
from contact_scenes import PUSH, elbow_direction, elbow_pushed
from test_yielding import EPOCH, LIMITS

from redres_ros import LAWS, Compliance, Controller, Posture, RobotModel, make_law
from redres_ros.errors import ArrayError
from redres_ros.limits.joint import VelocityLimit
from redres_ros.loop.command_loop import CommandLoop
from redres_ros.loop.modes import Mode
from redres_ros.policy import make_policy
from redres_ros.robot_model import RobotState, TickContext

pytestmark = pytest.mark.slow

T = 0.002  # [s]


@pytest.mark.parametrize(
    'arm',
    ['fr3', *(pytest.param(arm, marks=pytest.mark.nightly) for arm in ('iiwa7', 'lwr4', 'gen3'))],
)
@pytest.mark.parametrize('presses', [True, pytest.param(False, marks=pytest.mark.nightly)])
def test_the_elbow_gives_and_comes_back_while_the_tip_keeps_its_place(
    arm: str, presses: bool
) -> None:
    run = elbow_pushed(arm, presses=presses)
    assert run.elbow.max() >= 0.03
    if not presses:
        assert np.linalg.norm(run.tip, axis=1).max() < 2e-4
        return
    # posture 4 and damping 10 leave exp(-0.42 * 6) = 8 % after six seconds
    assert abs(run.elbow[-1]) < 0.15 * run.elbow.max()
    assert run.rms < 0.05
    assert np.linalg.norm(run.tip[:, :2], axis=1).max() < 4e-4


def with_torques(model: RobotModel, torques: np.ndarray) -> RobotState:
    tick = TickContext({'external_torques': torques})
    return RobotState(model, np.array(model.arm.start), np.zeros(model.n), tick=tick)


def test_the_acceleration_is_the_gain_times_the_torques_in_the_metric_of_the_law() -> None:
    model = RobotModel.named('fr3')
    compliance = Compliance(gain=2.0)
    torques = np.arange(7.0)
    state = with_torques(model, torques)
    for law in LAWS:
        W = make_law(law).weight(state)
        ddq_N = compliance.acceleration_in(state, W)
        W = np.eye(7) if W is None else np.asarray(W)
        assert W @ ddq_N == pytest.approx(2.0 * torques, abs=1e-7)  # W has a condition of 1e8
    assert not compliance.acceleration(RobotState(model, state.q, state.q)).any()
    with pytest.raises(ArrayError, match='expected 7 values'):
        compliance.acceleration(with_torques(model, np.zeros(3)))


def test_a_policy_names_what_its_preferences_and_limits_measure() -> None:
    class Watched(VelocityLimit):
        measurement = 'person_distance'

    model = RobotModel.named('fr3')
    policy = make_policy(
        model, 'minimum_acceleration', preferences=['compliance'], limits=[Watched(model)]
    )
    assert policy.measurements == {'external_torques', 'person_distance'}


@pytest.mark.parametrize('law', LAWS)
def test_a_force_on_the_tip_moves_nothing_in_the_null_space(law: str) -> None:
    model = RobotModel.named('fr3')
    q = np.array(model.arm.start)
    tip_force = model.state(q, q).J[:3].T @ np.array((5.0, -10.0, 20.0))
    commands = []
    for torques in (np.zeros(7), tip_force):
        controller = Controller(model, law, T, preferences=['compliance'])
        controller.measurements = {'external_torques': torques}
        commands.append(controller.update(q, np.zeros(3)).dq)
    assert commands[1] == pytest.approx(commands[0], abs=1e-9)


class TorqueLoop:
    """An ideal arm behind a command loop, with torques from outside."""

    def __init__(self) -> None:
        self.model = RobotModel.named('fr3')
        self.q = np.array(self.model.arm.start)
        law = make_law('minimum_acceleration', damping=10.0)
        preferences = (Compliance(), Posture())
        controller = Controller(
            self.model, law, T, switch_time=0.1, limits=LIMITS, preferences=preferences
        )
        self.loop = CommandLoop(controller)
        self.tick = 0

    def run(self, seconds: float, torques: np.ndarray | None) -> np.ndarray:
        """References (N, n) [rad] while torques (n,) [Nm] are measured, or none are."""
        references = []
        for _ in range(round(seconds / T)):
            self.tick += 1
            if torques is not None:
                self.loop.measurements.enter('external_torques', 0, torques)
            stamp = EPOCH + round(self.tick * T * 1e9)
            response = self.loop.step(stamp, self.q, self.tick * T)
            assert response is not None
            self.q = response.command.q_ref
            references.append(self.q)
        return np.array(references)


def test_an_arm_at_rest_yields_to_torques_comes_back_and_holds() -> None:
    arm = TorqueLoop()
    start = arm.q
    x0, _ = arm.model.tip(start)
    push = arm.model.jacobian(start, arm.model.elbow_frame)[:3].T @ (
        PUSH * elbow_direction(arm.model.state(start, np.zeros(7)))
    )
    assert (arm.run(0.2, np.zeros(7)) == start).all()
    arm.run(1.0, push)
    assert arm.loop.mode is Mode.MOVING
    assert np.abs(arm.q - start).max() > 0.05
    arm.run(25.0, np.zeros(7))
    assert arm.loop.mode is Mode.HOLDING
    # it holds once it is slower than 1e-4 rad/s, with posture and damping 2.5e-4 rad away
    assert arm.q == pytest.approx(start, abs=1e-3)
    assert arm.model.tip(arm.q)[0] == pytest.approx(x0, abs=1e-4)


def test_torques_of_another_length_stop_the_arm_and_every_state_gets_a_command() -> None:
    arm = TorqueLoop()
    arm.run(0.5, np.full(7, 5.0))
    assert arm.loop.mode is Mode.MOVING
    arm.run(1.0, np.zeros(3))
    assert 'expected 7 values' in arm.loop.error
    before = arm.q
    assert (arm.run(0.2, np.zeros(3)) == before).all()
