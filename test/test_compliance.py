"""An elbow that yields to a push while the tip keeps its force, and comes back."""

import numpy as np
import pytest
from contact_scenes import PUSH, elbow_direction, elbow_pushed
from test_command_loop import JOINT_LIMITS, T
from test_yielding import LoopedArm

from redres_ros import LAWS, Compliance, Controller, Posture, RobotModel, make_law
from redres_ros.errors import ArrayError
from redres_ros.limits.joint import VelocityLimit
from redres_ros.loop.modes import Mode
from redres_ros.policy import make_policy
from redres_ros.robot_model import RobotState, TickContext

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    'arm',
    ['fr3', *(pytest.param(arm, marks=pytest.mark.nightly) for arm in ('iiwa7', 'lwr4', 'gen3'))],
)
@pytest.mark.parametrize('presses', [True, pytest.param(False, marks=pytest.mark.nightly)])
def test_the_elbow_gives_and_comes_back_while_the_tip_keeps_its_place(arm, presses):
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
    with pytest.raises(ArrayError, match=r'expected \(7,\)'):
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


def yielding_arm() -> LoopedArm:
    """An FR3 that yields to torques from outside."""
    model = RobotModel.named('fr3')
    law = make_law('minimum_acceleration', damping=10.0)
    controller = Controller(
        model, law, T, switch_time=0.1, limits=JOINT_LIMITS, preferences=(Compliance(), Posture())
    )
    return LoopedArm(controller, np.array(model.arm.start))


def test_an_arm_at_rest_yields_to_torques_comes_back_and_holds() -> None:
    arm = yielding_arm()
    start = arm.q
    x0, _ = arm.model.tip(start)
    push = arm.model.jacobian(start, arm.model.elbow_frame)[:3].T @ (
        PUSH * elbow_direction(arm.model.state(start, np.zeros(7)))
    )
    assert (arm.run(0.2, torques=np.zeros(7)) == start).all()
    arm.run(1.0, torques=push)
    assert arm.loop.mode is Mode.MOVING
    assert np.abs(arm.q - start).max() > 0.05
    arm.run(25.0, torques=np.zeros(7))
    assert arm.loop.mode is Mode.HOLDING
    # it holds once it is slower than 1e-4 rad/s, with posture and damping 2.5e-4 rad away
    assert arm.q == pytest.approx(start, abs=1e-3)
    assert arm.model.tip(arm.q)[0] == pytest.approx(x0, abs=1e-4)


def test_torques_of_another_length_stop_the_arm_and_every_state_gets_a_command() -> None:
    arm = yielding_arm()
    arm.run(0.5, torques=np.full(7, 5.0))
    assert arm.loop.mode is Mode.MOVING
    arm.run(1.0, torques=np.zeros(3))
    assert 'expected (7,)' in arm.loop.error
    before = arm.q
    assert (arm.run(0.2, torques=np.zeros(3)) == before).all()
