"""What the tip of the fake robot touches: force, friction, torques."""

from typing import Any

import numpy as np
import pytest

from redres_ros.errors import ArrayError, UnknownNameError
from redres_ros.fake_robot.mujoco_arm import EnvironmentSettings, _normal
from redres_ros.fake_robot.plant import MujocoPlant
from redres_ros.robot_model import RobotModel

T = 0.002  # [s]
MODEL = RobotModel.named('fr3')
Q0 = np.array(MODEL.arm.start)
X0, _ = MODEL.tip(Q0)
J_PINV = np.linalg.pinv(MODEL.jacobian(Q0, MODEL.arm.tip_frame))[:, :3]


def plant_at(shape: str, **settings: Any) -> MujocoPlant:
    """The arm at its start, where its tip just touches the shape."""
    given = {'contact_position': tuple(X0), **settings}
    environment = EnvironmentSettings(contact_shape=shape, **given)
    return MujocoPlant(MODEL.arm, T, Q0, environment=environment)


def moved(plant: MujocoPlant, path: tuple[float, float, float]) -> np.ndarray:
    """The force on the tip in the base frame (3,) [N] once its reference has moved (3,) [m]."""
    dq = J_PINV @ path
    for k in range(1, 501):
        plant.step(Q0 + min(k / 100.0, 1.0) * dq)
    return force_on(plant)


def force_on(plant: MujocoPlant) -> np.ndarray:
    """The force on the tip in the base frame (3,) [N]."""
    _, R = MODEL.tip(plant.q)
    force: np.ndarray = R @ plant.wrench[:3]
    return force


@pytest.mark.parametrize('stiffness', [1e3, 1e4, 1e5])
def test_a_wall_pushes_back_with_its_stiffness_times_the_depth(stiffness: float) -> None:
    plant = plant_at('wall', contact_stiffness=stiffness, contact_friction=0.0)
    force = moved(plant, (0.001, 0.0, 0.0))
    depth = MODEL.tip(plant.q)[0][0] - X0[0]
    # one part in a million: at rest the contact is a spring, to the solver's tolerance
    assert force[0] == pytest.approx(-stiffness * depth, rel=1e-6)


@pytest.mark.parametrize(('x', 'y'), [(0.5, 0.0), (-0.3, 0.4), (0.0, -0.2)])
def test_a_wall_faces_the_base(x: float, y: float) -> None:
    normal = _normal(EnvironmentSettings('wall', (x, y, 0.7)))
    assert normal == pytest.approx(-np.array((x, y, 0.0)) / np.hypot(x, y))


def test_a_table_pushes_up_and_nothing_pulls() -> None:
    assert moved(plant_at('table'), (0.0, 0.0, -0.001))[2] > 5.0
    assert not moved(plant_at('table'), (0.0, 0.0, 0.001)).any()


def test_a_tip_that_slides_feels_friction_against_its_motion() -> None:
    plant = plant_at('table', contact_friction=0.3)
    down = J_PINV @ (0.0, 0.0, -0.002)
    along = J_PINV @ (0.0, 0.05, 0.0)
    for k in range(1, 301):
        plant.step(Q0 + min(k / 100.0, 1.0) * down + max(k - 100, 0) * T * along)
    force = force_on(plant)
    # 2 %: at 50 mm/s a softened friction cone is nearly at its edge
    assert force[1] == pytest.approx(-0.3 * force[2], rel=0.02)


def test_efforts_and_external_torques_explain_the_motion() -> None:
    plant = plant_at('wall')
    moved(plant, (0.001, 0.0, 0.0))
    state = MODEL.state(plant.q, np.zeros(MODEL.n))
    # n = tau + tau_ext at rest; 1e-6 Nm is what the servos still move
    assert plant.effort + plant.external_torques == pytest.approx(state.n, abs=1e-6)


def test_a_push_on_the_elbow_acts_on_the_joints_before_it_alone() -> None:
    plant = MujocoPlant(MODEL.arm, T, Q0)
    elbow = MODEL.elbow_frame
    push = np.array((0.0, 30.0, 0.0))
    plant.push(push, elbow)
    expected = MODEL.jacobian(Q0, elbow)[:3].T @ push
    assert plant.external_torques == pytest.approx(expected, abs=1e-9)
    assert not plant.wrench.any()


@pytest.mark.parametrize(
    ('settings', 'error', 'words'),
    [
        ({'contact_shape': 'floor'}, UnknownNameError, 'none, table, wall'),
        ({'contact_position': (0.0, 0.0)}, ArrayError, 'holds 2 numbers; expected 3'),
        (
            {'contact_shape': 'wall', 'contact_position': (0.0, 0.0, 1.0)},
            ArrayError,
            'above the base; expected beside it',
        ),
    ],
)
def test_a_surface_that_cannot_be_is_refused(settings: Any, error: type, words: str) -> None:
    with pytest.raises(error, match=words):
        EnvironmentSettings(**settings)
