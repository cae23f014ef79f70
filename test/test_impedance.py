"""The admittance behind a position interface: impedance and force control of second order, and a
mass, damper and spring. It answers Section 7 of the paper.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from contact_scenes import elbow_direction

from redres_ros.contact import Admittance, AdmittanceSettings
from redres_ros.controller import Controller
from redres_ros.fake_robot.plant import IdealPlant
from redres_ros.laws import make_law
from redres_ros.paper.second_order import Scheme
from redres_ros.preferences import Compliance
from redres_ros.robot_model import RobotModel, RobotState, TickContext

pytestmark = pytest.mark.slow

T = 0.001  # [s]
LASTS = 2.0  # [s]
DAMPING = 10.0  # k_d [1/s]
COMPLIANCE = Compliance(gain=1.0)
IMPEDANCE = AdmittanceSettings(
    enabled=True, mass=(5.0,) * 3, damping=(100.0,) * 3, stiffness=(500.0,) * 3
)
FORCE_CONTROL = AdmittanceSettings(
    enabled=True,
    mass=(5.0,) * 3,
    damping=(100.0, 100.0, 1000.0),
    stiffness=(500.0, 500.0, 0.0),
    force=(0.0, 0.0, 20.0),
)
STEP = 10.0  # [N] along y

Force = Callable[[float, np.ndarray], np.ndarray]  # of time [s] and tip (3,) [m], (3,) [N]


def push_at(t: float) -> float:
    """Rises and falls smoothly within a second, from 0 to 1 and back."""
    return float(np.sin(np.pi * t) ** 2) if 0.0 < t < 1.0 else 0.0


def pushed_tip(t: float, depth: np.ndarray) -> np.ndarray:
    """A hand that pushes the tip sideways."""
    return 20.0 * push_at(t) * np.array((0.6, 0.8, 0.0))


def wall_below(t: float, depth: np.ndarray) -> np.ndarray:
    """A table of 10 kN/m at the start of the tip, and the hand."""
    return pushed_tip(t, depth) + np.array((0.0, 0.0, 1e4 * max(-depth[2], 0.0)))


class Arm:
    """An FR3, and the force on its elbow."""

    def __init__(self, push: float) -> None:
        self.model = RobotModel.named('fr3')
        self.q0 = np.array(self.model.arm.start)
        start = self.model.state(self.q0, np.zeros(self.model.n))
        self.x0 = start.x
        self._push = push * elbow_direction(start)

    def state(self, t: float, q: np.ndarray, dq: np.ndarray) -> RobotState:
        J = self.model.jacobian(q, self.model.elbow_frame)[:3]
        measurements = {Compliance.measurement: J.T @ (push_at(t - 0.5) * self._push)}
        return RobotState(self.model, q, dq, tick=TickContext(measurements))


def by_velocity(
    law: str,
    settings: AdmittanceSettings,
    force: Force,
    *,
    elbow_push: float = 10.0,
    T: float = T,
) -> tuple[np.ndarray, np.ndarray]:
    """dq (N, n) and the tip's motion (N, 3) by the admittance, of an ideal arm."""
    arm = Arm(elbow_push)
    plant = IdealPlant(arm.model.joint_names, T, arm.q0)
    controller = Controller(arm.model, make_law(law, damping=DAMPING), T, preferences=(COMPLIANCE,))
    admittance = Admittance(settings, T)
    rows = []
    for k in range(round(LASTS / T)):
        state = arm.state(k * T, plant.q, np.zeros(arm.model.n))
        f = force(k * T, state.x - arm.x0)
        controller.measurements = state.measurements
        wrench = np.append(f, np.zeros(3))
        command = controller.update(plant.q, admittance.rate(wrench, state))
        admittance.record(command, np.zeros(3))
        rows.append((command.dq, state.x - arm.x0))
        plant.step(command.q_ref)
    dq, x = zip(*rows, strict=True)
    return np.array(dq), np.array(x)


def by_scheme(law: str, settings: AdmittanceSettings, force: Force) -> np.ndarray:
    """dq (N, n) of the impedance of second order, whose ddx a scheme of the paper executes: M dde +
    D (de + T dde) + K (e + T de + T^2 dde) = f - f_d.
    """
    arm = Arm(10.0)
    scheme = Scheme(law, DAMPING, COMPLIANCE)
    mass, damping, stiffness, desired = (
        np.array(getattr(settings, name)) for name in ('mass', 'damping', 'stiffness', 'force')
    )
    q = arm.q0
    dq = np.zeros(arm.model.n)
    e = np.zeros(3)
    de = np.zeros(3)
    J_prev = None
    rows = []
    for k in range(round(LASTS / T)):
        state = arm.state(k * T, q, dq)
        J = state.J[:3]
        drive = force(k * T, state.x - arm.x0) - desired - damping * de - stiffness * (e + T * de)
        dde = drive / (mass + T * damping + T**2 * stiffness)
        dJ = np.zeros_like(J) if J_prev is None else (J - J_prev) / T  # Eq. (9)
        dq = dq + T * scheme.acceleration(state, dde, dJ @ dq)  # Eq. (13)
        q = q + T * dq
        de = J @ dq
        e = e + T * de
        J_prev = J
        rows.append(dq)
    return np.array(rows)


@pytest.mark.parametrize(
    ('settings', 'force'), [(IMPEDANCE, pushed_tip), (FORCE_CONTROL, wall_below)]
)
@pytest.mark.parametrize(
    'law', ['minimum_acceleration', 'dynamically_consistent', 'minimum_weighted_torque']
)
def test_the_admittance_is_that_of_second_order_to_rounding(law, settings, force):
    dq, _ = by_velocity(law, settings, force)
    assert np.abs(dq - by_scheme(law, settings, force)).max() < 1e-9


def test_a_wrong_admittance_is_found_out():
    wrong = replace(IMPEDANCE, mass=(5.0, 5.001, 5.0))
    dq, _ = by_velocity('minimum_acceleration', wrong, pushed_tip)
    assert np.abs(dq - by_scheme('minimum_acceleration', IMPEDANCE, pushed_tip)).max() > 1e-9


def test_a_step_of_force_is_answered_like_the_analytic_mass_damper_and_spring():
    settings = AdmittanceSettings(
        enabled=True, mass=(4.0,) * 3, damping=(40.0,) * 3, stiffness=(400.0,) * 3
    )
    push = np.array((0.0, STEP, 0.0))
    _, x = by_velocity('minimum_acceleration', settings, lambda *_: push, elbow_push=0.0, T=0.002)
    t = 0.002 * np.arange(1000)
    omega = np.sqrt(75.0)  # K / M - (D / 2 M)^2
    decay = np.exp(-5.0 * t) * (np.cos(omega * t) + 5.0 / omega * np.sin(omega * t))
    end = STEP / 400.0
    assert np.abs(x[:, 1] - end * (1.0 - decay)).max() < 0.02 * end
