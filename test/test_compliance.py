"""An elbow that yields to a push while the tip keeps its force, and comes back."""

from typing import NamedTuple

import numpy as np
import pytest
from test_yielding import EPOCH, LIMITS

from redres_ros import Compliance, Controller, Posture, RobotModel, RobotState, make_law
from redres_ros.contact import AdmittanceSettings, ContactControl
from redres_ros.errors import ArrayError
from redres_ros.fake_robot.environment import EnvironmentSettings
from redres_ros.fake_robot.mujoco_arm import MujocoSettings
from redres_ros.fake_robot.plant import MujocoPlant
from redres_ros.loop.command_loop import CommandLoop
from redres_ros.loop.modes import Mode

T = 0.002  # [s]
FORCE = 20.0  # [N] of the tip
PUSH = 30.0  # [N] on the elbow
BEGIN = 1.5  # [s] of the push
END = 2.5  # [s]
LAST = 8.5  # [s]


class Pushed(NamedTuple):
    """From the push on: how far the elbow gives (N,) [m], what the tip does (N, 3) [m], and the
    force of the table (N,) [N].
    """

    elbow: np.ndarray
    tip: np.ndarray
    force: np.ndarray


def elbow_direction(state: RobotState) -> np.ndarray:
    """In which the elbow moves most while the tip rests, (3,)."""
    J = state.J[:3]
    P = np.eye(len(state.q)) - np.linalg.pinv(J) @ J
    U, _, _ = np.linalg.svd(state.jacobian(state.model.elbow_frame)[:3] @ P)
    direction: np.ndarray = U[:, 0]
    return direction * np.sign(direction[np.abs(direction).argmax()])


def pushed(arm: str, presses: bool) -> Pushed:
    """The elbow is pushed for a second, while the tip presses on a table or is free.

    Args:
        arm: Its name.
        presses: Whether there is a table.
    """
    model = RobotModel.named(arm)
    q0 = np.array(model.arm.start)
    at_rest = np.zeros(model.n)
    start = model.state(q0, at_rest)
    surface = tuple(start.x - np.array((0.0, 0.0, 0.001)))
    shape = 'table' if presses else 'none'
    servo = MujocoSettings(servo_bandwidth=400.0)
    plant = MujocoPlant(model.arm, T, q0, servo, EnvironmentSettings(shape, surface))
    controller = Controller(
        model,
        make_law('minimum_acceleration', damping=10.0),
        T,
        limits=LIMITS,
        preferences=(Compliance(), Posture()),
    )
    settings = AdmittanceSettings(
        enabled=presses, damping=(1e6, 1e6, 1000.0), force=(0.0, 0.0, FORCE)
    )
    contact = ContactControl(settings, T)
    direction = elbow_direction(start)
    rows = []
    for t in np.arange(0.0, LAST, T):
        plant.push(PUSH * direction * (BEGIN <= t < END), model.elbow_frame)
        state = model.state(plant.q, at_rest)
        elbow = model.position(plant.q, model.elbow_frame) @ direction
        rows.append((elbow, *state.x, (state.R @ plant.wrench[:3])[2]))
        contact.sensor.enter(plant.wrench)
        controller.measurements = {'external_torques': plant.external_torques}
        command = controller.update(plant.q, contact.velocity(np.zeros(3), state))
        contact.record(command, np.zeros(3))
        plant.step(command.q_ref)
    table = np.array(rows)[round(BEGIN / T) :]
    return Pushed(table[:, 0] - table[0, 0], table[:, 1:4] - table[0, 1:4], table[:, 4])


@pytest.mark.parametrize(
    'arm',
    ['fr3', *(pytest.param(arm, marks=pytest.mark.nightly) for arm in ('iiwa7', 'lwr4', 'gen3'))],
)
def test_the_elbow_gives_while_the_tip_presses_and_comes_back(arm: str) -> None:
    run = pushed(arm, presses=True)
    assert run.elbow.max() >= 0.03
    # posture 4 and damping 10 leave exp(-0.42 * 6) = 8 % after six seconds
    assert abs(run.elbow[-1]) < 0.15 * run.elbow.max()
    assert np.sqrt(np.mean((run.force - FORCE) ** 2)) < 0.05
    assert np.linalg.norm(run.tip[:, :2], axis=1).max() < 4e-4


@pytest.mark.nightly
@pytest.mark.parametrize('arm', ['fr3', 'iiwa7', 'lwr4', 'gen3'])
def test_the_elbow_gives_while_the_tip_rests_in_free_space(arm: str) -> None:
    run = pushed(arm, presses=False)
    assert run.elbow.max() >= 0.03
    assert np.linalg.norm(run.tip, axis=1).max() < 2e-4


# --- the measurement ------------------------------------------------------------------------------


def test_the_acceleration_is_the_gain_times_the_torques_from_outside() -> None:
    model = RobotModel.named('fr3')
    state = model.state(np.array(model.arm.start), np.zeros(model.n))
    compliance = Compliance(gain=2.0)
    assert not compliance.acceleration(state).any()
    torques = np.arange(7.0)
    state.measurements = {'external_torques': torques}
    assert (compliance.acceleration(state) == 2.0 * torques).all()
    state.measurements = {'external_torques': np.zeros(3)}
    with pytest.raises(ArrayError, match='expected 7 values'):
        compliance.acceleration(state)


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
                self.loop.enter_measurement('external_torques', 0, torques)
            stamp = EPOCH + round(self.tick * T * 1e9)
            response = self.loop.enter_state(stamp, self.q, self.tick * T)
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
    assert arm.loop.gate.count == 0


def test_torques_of_another_length_stop_the_arm_and_every_state_is_answered() -> None:
    arm = TorqueLoop()
    arm.run(0.5, np.full(7, 5.0))
    assert arm.loop.mode is Mode.MOVING
    arm.run(1.0, np.zeros(3))
    assert 'expected 7 values' in arm.loop.error
    before = arm.q
    assert (arm.run(0.2, np.zeros(3)) == before).all()
    assert arm.loop.gate.count == 0


def test_torques_that_are_no_longer_measured_move_nothing() -> None:
    arm = TorqueLoop()
    arm.run(0.1, np.full(7, 5.0))
    arm.run(15.0, None)
    before = arm.q
    assert (arm.run(0.2, None) == before).all()
