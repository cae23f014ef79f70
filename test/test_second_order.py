"""The original schemes. One that is added to the table SCHEMES goes through every test of the first
part by itself.
"""

import numpy as np
import pytest

from redres_ros import make_law, resolve
from redres_ros.errors import UnknownNameError
from redres_ros.paper.second_order import SCHEMES, Scheme, SecondOrderController

T = 0.001  # [s]
DX = np.array((0.2, -0.1, 0.3))  # [m/s]
# Relative to the size of what is compared. The law of least torque solves with M M, of a condition
# below 1e7 here, and so loses 7 of 16 digits; differences (8), (9) lose 3 more, of which (13) gives
# 3 back.
ROUNDING = 1e-8
EVERY_SCHEME = pytest.mark.parametrize('name', SCHEMES)
EVERY_DAMPING = pytest.mark.parametrize('damping', [0.0, 10.0, 1.0 / T])


def same(got: np.ndarray, expected: np.ndarray) -> bool:
    return np.linalg.norm(got - expected) <= ROUNDING * np.linalg.norm(expected)


@EVERY_SCHEME
@EVERY_DAMPING
def test_from_the_same_past_law_and_scheme_command_the_same_velocity(name, damping, model, states):
    law = make_law(name, damping=damping)
    scheme = Scheme(name, damping)
    for state in states:
        # The tick before has executed its task: J_{k-1} dq_{k-1} = dx_{k-1}.
        J_prev = model.state(state.q - T * state.dq_prev, state.dq_prev).J[:3]
        ddx = (DX - J_prev @ state.dq_prev) / T  # Eq. (8)
        dq = resolve(state.J[:3], DX, law.bias(state, T), law.weight(state))
        assert same(scheme.step(state, J_prev, ddx, T), dq)


@EVERY_SCHEME
def test_the_arm_is_at_rest_before_the_first_tick(name, model, task):
    command = SecondOrderController(model, Scheme(name, 0.0), T).update(task.start, DX)
    assert not command.state.dq_prev.any()
    assert command.J @ command.ddq == pytest.approx(DX / T, rel=ROUNDING)


@pytest.mark.parametrize('name', ['minimum_velocity', 'minimum_kinetic_energy'])
def test_a_law_of_first_order_has_no_scheme(name):
    with pytest.raises(
        UnknownNameError, match=f"unknown scheme of second order '{name}'; allowed: dynamically_con"
    ):
        Scheme(name)
