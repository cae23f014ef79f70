"""The end of the reach: when it counts, and how fast the arm may go towards it."""

import numpy as np
import pytest

from redres_ros import Controller, RobotModel
from redres_ros.kernels.closed_form import is_far
from redres_ros.robots import ARMS
from redres_ros.singularity import end_of_reach

MODEL = RobotModel.named('lwr4')
NEAR = 0.02
LIMIT = np.array(ARMS['lwr4'].acceleration_limit)  # [rad/s^2]


def posture(*q: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """J (3, 7), dJ (7, 3, 7) and the way outward (3,)."""
    state = MODEL.state(np.array(q), np.zeros(7))
    x, _ = MODEL.tip(state.q)
    return state.jacobian('')[:3], state.jacobian_derivatives('')[:, :3], x / np.linalg.norm(x)


def bent(angle: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The same for the elbow's angle [rad]."""
    return posture(0.3, 0.6, 0.0, angle, 0.0, -angle / 3.0, 0.0)


def test_a_task_is_far_only_where_all_singular_values_are():
    random = np.random.default_rng(0)
    counts = {True: 0, False: 0}
    for _ in range(500):
        J = random.normal(size=(3, 7)) * 10.0 ** random.uniform(-3.0, 0.0, (3, 1))
        s = np.linalg.svd(J, compute_uv=False)
        far = bool(is_far(J, NEAR))
        counts[far] += 1
        assert not far or s[-1] >= NEAR * s[0]
    assert min(counts.values()) > 100


@pytest.mark.parametrize('angle', [0.06, 0.07, 0.08])
def test_towards_the_end_the_joints_could_keep_the_speed_that_is_left(angle):
    J, dJ, outward = bent(angle)
    s = np.linalg.svd(J, compute_uv=False)
    fade = 2.0 * s[-1] / (NEAR * s[0]) - 1.0
    assert 0.1 < fade < 1.0
    end = end_of_reach(J, dJ, outward, LIMIT, NEAR)
    (u,) = end.ended
    dq = np.linalg.pinv(J) @ (end.most[0] * np.sign(u @ outward) * u)
    ddq = -np.linalg.pinv(J) @ (np.einsum('icj,i->cj', dJ, dq) @ dq)  # at a constant tip speed
    share = np.abs(ddq) / LIMIT
    assert share.max() == pytest.approx(fade**2, rel=0.1)
    assert end_of_reach(J, dJ, 0.9 * end.most[0] * outward, LIMIT, NEAR) is None


def test_the_arm_comes_to_rest_before_the_end():
    J, dJ, outward = bent(0.02)
    assert end_of_reach(J, dJ, 1e-6 * outward, LIMIT, NEAR).most == [0.0]


def test_inward_sideways_and_far_off_there_is_no_end():
    J, dJ, outward = bent(0.02)
    assert end_of_reach(J, dJ, -outward, LIMIT, NEAR) is None
    sideways = np.linalg.svd(J)[0][:, 0]
    assert end_of_reach(J, dJ, sideways, LIMIT, NEAR) is None
    J, dJ, outward = bent(1.0)
    assert end_of_reach(J, dJ, outward, LIMIT, NEAR) is None


@pytest.mark.parametrize('side', [1.0, -1.0])
def test_where_a_self_motion_leads_on_there_is_no_end(side):
    J, dJ, _ = posture(0.0, 0.005, 1.57, -1.5, 0.0, 0.0, 0.0)
    across = np.linalg.svd(J)[0][:, -1]
    assert end_of_reach(J, dJ, side * across, LIMIT, NEAR) is None


def test_an_arm_that_swings_at_the_end_without_the_gain_rests_once_nothing_leads_it_outwards():
    T = 0.004
    limits = ('position', 'velocity', 'acceleration')
    controller = Controller(MODEL, 'minimum_acceleration', T, limits=limits)
    q = np.array(MODEL.arm.start)
    outward = 0.3 * MODEL.tip(q)[0]
    speeds = []
    for k in range(round(6.0 / T)):
        command = controller.update(q, outward if k * T < 3.5 else np.zeros(3))
        q = command.q_ref
        speeds.append(float(np.abs(command.dq).max()))
    before, after = np.split(np.array(speeds), (round(3.5 / T),))
    assert before[-round(0.5 / T) :].max() > 0.5
    assert after[-1] < 1e-3
