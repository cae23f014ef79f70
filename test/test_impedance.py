"""The admittance behind a position interface: impedance and force control of second order. It
answers Section 7 of the paper.
"""

from collections.abc import Callable

import numpy as np
import pytest
from contact_scenes import elbow_direction

from redres_ros.contact import AdmittanceSettings, ContactControl
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

    def __init__(self) -> None:
        self.model = RobotModel.named('fr3')
        self.q0 = np.array(self.model.arm.start)
        start = self.model.state(self.q0, np.zeros(self.model.n))
        self.x0 = start.x
        self._push = 10.0 * elbow_direction(start)

    def state(self, t: float, q: np.ndarray, dq: np.ndarray) -> RobotState:
        J = self.model.jacobian(q, self.model.elbow_frame)[:3]
        measurements = {Compliance.measurement: J.T @ (push_at(t - 0.5) * self._push)}
        return RobotState(self.model, q, dq, tick=TickContext(measurements))


def by_velocity(law: str, settings: AdmittanceSettings, force: Force) -> np.ndarray:
    """dq (N, n) by the admittance, of an ideal arm."""
    arm = Arm()
    plant = IdealPlant(arm.model.joint_names, T, arm.q0)
    controller = Controller(arm.model, make_law(law, damping=DAMPING), T, preferences=(COMPLIANCE,))
    contact = ContactControl(settings, T)
    rows = []
    for k in range(round(LASTS / T)):
        state = arm.state(k * T, plant.q, np.zeros(arm.model.n))
        f = force(k * T, state.x - arm.x0)
        controller.measurements = state.measurements
        contact.sensor.enter(np.append(state.R.T @ f, np.zeros(3)))
        command = controller.update(plant.q, contact.velocity(np.zeros(3), state))
        contact.record(command, np.zeros(3))
        rows.append(command.dq)
        plant.step(command.q_ref)
    return np.array(rows)


def by_scheme(law: str, settings: AdmittanceSettings, force: Force) -> np.ndarray:
    """dq (N, n) of the impedance of second order, whose ddx a scheme of the paper executes: M dde +
    D (de + T dde) + K (e + T de + T^2 dde) = f - f_d.
    """
    arm = Arm()
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
    dq = by_velocity(law, settings, force)
    assert np.abs(dq - by_scheme(law, settings, force)).max() < 1e-9
