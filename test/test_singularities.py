"""Into, in and out of the stretched arm at 500 Hz, for every arm of the table and every law."""

from collections.abc import Callable, Iterator
from functools import cache
from itertools import islice, product
from types import SimpleNamespace

import numpy as np
import pytest
from nightly import by_day
from scipy.optimize import minimize
from test_distance import BOX, T, model_of

from redres_ros import LAWS, Command, Controller, make_law
from redres_ros.geometry import quintic
from redres_ros.resolution import SINGULAR_RATIO
from redres_ros.robots import ARMS
from redres_ros.singularity import escape
from redres_ros.tasks import Position

SPEED = 0.05  # [m/s]
NO_GAINS: dict[str, float] = {}
BRAKING = {'acceleration.reach': 0.02}
# share of a path -> x_d (3,), and its slope by the share (3,)
Path = Callable[[float], tuple[np.ndarray, np.ndarray]]


@cache
def stretched(arm: str) -> tuple[np.ndarray, np.ndarray]:
    """Joint positions with the tip farthest from the base, (n,), and the way outward, (3,)."""
    model = model_of(arm)
    bounds = list(zip(model.q_min + 0.02, model.q_max - 0.02, strict=True))
    start = 0.7 * np.array(ARMS[arm].start) + 0.05

    def smallest_singular_value(q: np.ndarray) -> float:
        return -float(np.linalg.norm(model.tip(q)[0]))

    q = minimize(
        smallest_singular_value, start, bounds=bounds, options={'ftol': 1e-15, 'gtol': 1e-10}
    ).x
    q = np.round(q, 5)  # the digits after these change from version to version of the search
    x, _ = model.tip(q)
    return q, x / np.linalg.norm(x)


def has_stretched(arm: str) -> bool:
    """Whether the joints' ranges let the arm be stretched."""
    q, outward = stretched(arm)
    J = model_of(arm).state(q, np.zeros(len(q))).J[:3]
    return float(np.linalg.norm(outward @ J)) < 1e-3


STRETCHING = [arm for arm in ARMS if has_stretched(arm)]
EVERY_STRETCHED = pytest.mark.parametrize('arm', STRETCHING)
SOME_PAIRS = pytest.mark.parametrize(('arm', 'law'), by_day(12, product(STRETCHING, LAWS)))


def driven(
    arm: str, law: str, q: np.ndarray, ways: list[np.ndarray], gains=NO_GAINS
) -> list[Command]:
    """Commands to an ideal arm, for one task velocity a tick."""
    controller = Controller(model_of(arm), make_law(law), T, limits=BOX, limit_gains=gains)
    commands = []
    for dx in ways:
        command = controller.update(q, dx)
        commands.append(command)
        q = command.q_ref
    return commands


@cache
def led_inward(arm: str, law: str) -> list[Command]:
    """Commands of 0.8 s straight away from the stretched arm."""
    q, outward = stretched(arm)
    return driven(arm, law, q, [-SPEED * outward] * 400)


def check(arm: str, commands: list[Command]) -> None:
    allowed = np.array(ARMS[arm].acceleration_limit) * (1.0 + 1e-9)
    assert all((np.abs(command.ddq) <= allowed).all() for command in commands)


def still(commands: list[Command]) -> int:
    """Ticks in which nothing moves."""
    return sum(not command.dq.any() for command in commands)


def test_most_arms_can_be_stretched():
    assert {'lwr4', 'lwr4_paper', 'iiwa7', 'fr3', 'planar4r'} <= set(STRETCHING)


@SOME_PAIRS
def test_from_the_stretched_arm_it_goes_inward_at_once_and_soon_exactly(arm, law):
    q, outward = stretched(arm)
    commands = led_inward(arm, law)
    check(arm, commands)
    assert still(commands) <= 2
    x, _ = model_of(arm).tip(q)
    x_end, _ = model_of(arm).tip(commands[-1].q_ref)
    assert -(x_end - x) @ outward > 0.7 * 400 * T * SPEED


# the command of a tick, the velocity that was asked for (3,), and the error [m]
Tick = tuple[Command, np.ndarray, float]


def ticks_along(
    arm: str, law: str, q: np.ndarray, path: Path, duration: float, gains=NO_GAINS
) -> Iterator[Tick]:
    """A path by its share (0 to 1), at rest at both ends; the clock goes on by s T."""
    model = model_of(arm)
    controller = Controller(model, make_law(law), T, limits=BOX, limit_gains=gains)
    t = 0.0
    while t < duration:
        share, rate = quintic(t / duration)
        x_d, slope = path(share)
        error = x_d - model.tip(q)[0]
        dx = slope * rate / duration + 10.0 * error
        command = controller.update(q, dx)
        yield command, dx, float(np.linalg.norm(error))
        t += command.s * T
        q = command.q_ref


def inward(arm: str) -> Path:
    q, outward = stretched(arm)
    x, _ = model_of(arm).tip(q)
    way = -0.1 * outward
    return lambda share: (x + share * way, way)


def is_damped(arm: str, command: Command) -> bool:
    """Whether a direction of the task is damped."""
    rank = 2 if arm == 'planar4r' else 3
    values = np.linalg.svd(command.J, compute_uv=False)[:rank]
    return bool(values[-1] < SINGULAR_RATIO * values[0])


@pytest.mark.slow
@SOME_PAIRS
def test_within_limits_it_is_on_its_path_at_once_and_at_full_speed_soon(arm, law):
    """At full speed before the path is at its fastest, half way."""
    q, _ = stretched(arm)
    duration = 1.0  # [s]
    t = 0.0  # [s] of the path's clock
    is_out = False
    for command, dx, error in ticks_along(arm, law, q, inward(arm), duration):
        is_out = not is_damped(arm, command)
        if is_out:
            assert command.J @ command.dq == pytest.approx(command.s * dx, abs=1e-9)
            assert error < 0.2e-3
        if is_out and command.s == 1.0:
            break
        t += command.s * T
    assert is_out
    assert t < 0.5 * duration


def tangent(arm: str) -> np.ndarray:
    """A direction (3,) in which the stretched arm can move."""
    q, _ = stretched(arm)
    J = model_of(arm).state(q, np.zeros(len(q))).J[:3]
    return np.linalg.svd(J)[0][:, 0]


def arc(arm: str, width: float) -> tuple[np.ndarray, Path]:
    """Joint positions (n,) from which an arc [m] goes out to the end of the reach and back."""
    q, outward = stretched(arm)
    x_far, _ = model_of(arm).tip(q)
    way = width * tangent(arm)
    bent = led_inward(arm, 'minimum_velocity')[-1].q_ref
    x, _ = model_of(arm).tip(bent)
    depth = float((x_far - x) @ outward)

    def path(share: float) -> tuple[np.ndarray, np.ndarray]:
        height = depth * (1.0 - (2.0 * share - 1.0) ** 2)
        slope = -4.0 * depth * (2.0 * share - 1.0)
        return x + share * way + height * outward, way + slope * outward

    return bent, path


@pytest.mark.slow
@EVERY_STRETCHED
def test_a_path_beyond_the_reach_goes_on_along_it_and_is_exact_again_within(arm):
    """The middle of an arc of 20 cm is 5 mm and more out of reach; it crept there for ever."""
    bent, path = arc(arm, 0.2)
    ticks = ticks_along(arm, 'minimum_velocity', bent, path, 5.0, gains=BRAKING)
    found = list(islice(ticks, 4000))
    commands = [command for command, _, _ in found]
    check(arm, commands)
    assert still(commands) <= 2
    assert len(found) * T < 1.05 * 5.0
    # and that is reported
    assert max(np.linalg.norm(command.unachieved) for command in commands) > 0.01
    for command, dx, _ in found[-len(found) // 4 :]:
        assert command.J @ command.dq == pytest.approx(dx, abs=1e-9)
    _, _, error = found[-1]
    assert error < 1e-4


@EVERY_STRETCHED
def test_beside_the_end_of_the_reach_the_arm_brakes_before_it(arm):
    """Far faster towards the end than it could stop: what is too much is left, and no other way."""
    q, outward = stretched(arm)
    model = model_of(arm)
    bent = led_inward(arm, 'minimum_velocity')[99].q_ref
    sideways = SPEED * tangent(arm)
    ways = [SPEED * outward + sideways] * 200
    commands = driven(arm, 'minimum_velocity', bent, ways, BRAKING)
    check(arm, commands)
    last = commands[-1]
    assert last.s == 1.0
    assert last.J @ last.dq @ sideways == pytest.approx(sideways @ sideways, rel=0.1)
    x, _ = model.tip(last.q_ref)
    x_far, _ = model.tip(q)
    assert np.linalg.norm(x) <= np.linalg.norm(x_far) + 1e-6


def test_an_arm_ten_times_as_large_escapes_with_the_same_joint_velocities():
    q, outward = stretched('lwr4')
    state = model_of('lwr4').state(q, np.zeros(7))
    J = state.J[:3]
    dJ = state.jacobian_derivatives('')[:, :3]
    expected = escape(state, Position(), J, -SPEED * outward)
    assert np.linalg.norm(expected) > 0.01
    large = SimpleNamespace(
        model=SimpleNamespace(reach=10.0 * state.model.reach), dq_prev=np.zeros(7)
    )
    task = SimpleNamespace(derivatives=lambda state: 10.0 * dJ, row_scale=lambda model: None)
    z = escape(large, task, 10.0 * J, -10.0 * SPEED * outward)
    assert z == pytest.approx(expected, abs=1e-9)


@EVERY_STRETCHED
def test_outward_of_it_there_is_no_escape_and_that_is_reported(arm):
    q, outward = stretched(arm)
    command = driven(arm, 'minimum_velocity', q, [SPEED * outward] * 3)[0]
    assert np.linalg.norm(command.unachieved) == pytest.approx(SPEED, rel=1e-2)
