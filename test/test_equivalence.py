"""Laws beside their schemes over whole tasks, sampled and in continuous time: the paper's claim of
equivalence.
"""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from nightly import by_day
from scipy.integrate import solve_ivp

from redres_ros import Controller, RobotModel, WaypointTask, make_law, resolve
from redres_ros.geometry import quintic
from redres_ros.laws import Law
from redres_ros.paper.claims import ROUNDING
from redres_ros.paper.experiment import velocity_difference
from redres_ros.paper.second_order import SCHEMES, Scheme, SecondOrderController
from redres_ros.planning.planner import Planner
from redres_ros.preferences import JointCentering
from redres_ros.simulation.closed_loop import run

pytestmark = pytest.mark.slow

EVERY_SCHEME = pytest.mark.parametrize('name', by_day(2, SCHEMES))
PERIODS = (0.008, 0.004, 0.002)  # [s]


@pytest.fixture(scope='module')
def heavy() -> RobotModel:
    """The paper's arm with the identified dynamics, on which no law with damping is unstable."""
    return RobotModel.named('lwr4_paper', dynamics='identified')


@pytest.fixture(scope='module')
def side(task: WaypointTask) -> WaypointTask:
    """The first side of the paper's rectangle."""
    return replace(task, waypoints=task.waypoints[:2])


def difference(law: Law, scheme: Scheme, T: float, task: WaypointTask, model: RobotModel) -> float:
    """Largest |dq_I - dq_II| [rad/s] of a law and a scheme, each in a closed loop of its own, both
    with the scheme's preference.
    """
    preferences = (scheme.preference,) if scheme.preference else ()
    one = run(Controller(model, law, T, preferences=preferences), task)
    two = run(SecondOrderController(model, scheme, T), task)
    return float(velocity_difference(one, two).max())


def integrate(
    scheme: Scheme, model: RobotModel, side: WaypointTask, times: np.ndarray
) -> np.ndarray:
    """q at those times (N, n) [rad], as a scheme executes a segment in continuous time.

    ddx = ddx_d + k_P (dx_d - J dq) is the derivative of Eq. (37), with which the motion begins: at
    the least velocity that fulfils it, as the first tick of a law does for T to zero.
    """
    way = side.waypoints[1] - side.waypoints[0]
    T_AB = side.segment_time
    h = 1e-5  # [s]; differences over it miss dJ by 1e-10

    def flow(t: float, y: np.ndarray) -> np.ndarray:
        q, dq = np.split(y, 2)
        state = model.state(q, dq)
        xi = t / T_AB
        ddx_d = way / T_AB**2 * (60.0 * xi * (1.0 + xi * (2.0 * xi - 3.0)))
        dx_d = way / T_AB * quintic(xi)[1]  # Eq. (36)
        dJ = (model.state(q + h * dq, dq).J[:3] - model.state(q - h * dq, dq).J[:3]) / (2.0 * h)
        ddx = ddx_d + side.feedback_gain * (dx_d - state.J[:3] @ dq)
        return np.concatenate((dq, scheme.acceleration(state, ddx, dJ @ dq)))

    start = model.state(side.start, np.zeros(model.n))
    dx = Planner(side).reference(start.x, 0.0).dx
    dq = resolve(start.J[:3], dx, np.zeros(model.n), scheme.metric(start))
    y = np.concatenate((start.q, dq))
    solution = solve_ivp(flow, (0.0, T_AB), y, 'DOP853', times, rtol=1e-8, atol=1e-10)
    return solution.y[: model.n].T


@pytest.mark.parametrize(
    ('name', 'damping', 'T'),
    by_day(
        1,
        [
            ('minimum_acceleration', 10.0, 0.001),  # Fig. 5
            ('dynamically_consistent', 500.0, 0.002),  # Fig. 16, ideal, forwards
        ],
    ),
)
def test_over_the_whole_task_law_and_scheme_differ_by_rounding(name, damping, T, task, model):
    law = make_law(name, damping=damping)
    assert difference(law, Scheme(name, damping), T, task, model) < ROUNDING


@pytest.mark.parametrize(('name', 'damping'), by_day(4, product(SCHEMES, [10.0, 500.0])))
def test_on_an_arm_that_a_law_keeps_stable_law_and_scheme_differ_by_rounding(
    name, damping, side, heavy
):
    law = make_law(name, damping=damping)
    short = replace(side, segment_time=1.0)
    assert difference(law, Scheme(name, damping), 0.002, short, heavy) < ROUNDING


@pytest.mark.parametrize(
    ('law', 'scheme'),
    [
        # Appendix B: damped by 1/T, least acceleration becomes least velocity
        ('minimum_velocity', Scheme('minimum_acceleration', 500.0)),
        # Eqs. (18), (19)
        ('minimum_acceleration', Scheme('minimum_acceleration', 10.0, JointCentering(gain=400.0))),
    ],
    ids=['full damping', 'preference'],
)
def test_a_scheme_that_is_damped_fully_or_prefers_a_motion_has_its_law_too(
    law, scheme, side, heavy
):
    short = replace(side, segment_time=1.0)
    found = difference(make_law(law, damping=10.0), scheme, 0.002, short, heavy)
    assert found < ROUNDING


def test_a_scheme_is_seen_to_be_another_if_its_damping_is_off_by_a_millionth(side, model):
    name = 'dynamically_consistent'
    short = replace(side, segment_time=0.5)
    found = difference(make_law(name, damping=10.0), Scheme(name, 10.0 + 1e-6), 0.002, short, model)
    assert found > ROUNDING


@EVERY_SCHEME
def test_the_laws_converge_to_the_continuous_schemes_with_the_first_order(name, side, heavy):
    scheme = Scheme(name, 10.0)
    law = make_law(name, damping=10.0)
    errors = []
    for T in PERIODS:
        sampled = run(Controller(heavy, law, T), side)
        watched = sampled['t'] <= side.segment_time
        q = integrate(scheme, heavy, side, sampled['t'][watched])
        errors.append(np.linalg.norm(sampled.vectors('q1')[watched] - q, axis=1).max())
    assert 0.9 < np.polyfit(np.log(PERIODS), np.log(errors), 1)[0] < 1.1
