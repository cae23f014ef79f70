"""Controller: what it integrates, what it survives, and how it goes from one law to another."""

import copy
import gc
from collections.abc import Callable
from itertools import permutations, product

import numpy as np
import pytest
from doubles import FloatingArm
from nightly import by_day

from redres_ros import (
    LAWS,
    Command,
    Controller,
    Law,
    Planner,
    RobotModel,
    WaypointTask,
    make_law,
    resolve,
)
from redres_ros.command import Published
from redres_ros.errors import ArrayError, RangeError, RedresError
from redres_ros.geometry import quintic
from redres_ros.robot_model import Correction

T = 0.002  # [s]
SWITCH_TIME = 0.5  # [s]
DX = np.array((0.0, -0.1, 0.0))  # [m/s]
ROUNDING = 1e-12  # of joint positions and velocities of order 1
PAIRS = pytest.mark.parametrize(('old', 'new'), by_day(10, permutations(LAWS, 2)))


def controller_of(
    model: RobotModel, law: str = 'minimum_acceleration', **options: float | str
) -> Controller:
    return Controller(model, make_law(law), T, **options)


def alone(law: Law, command: Command, dx: np.ndarray) -> np.ndarray:
    """dq of that law at a command's state, without controller."""
    return resolve(command.J, dx, law.bias(command.state, T), law.weight(command.state))


class Drive:
    """A controller on its way through a task with an ideal arm; a copy goes on by itself."""

    def __init__(self, controller: Controller, task: WaypointTask) -> None:
        self.controller = controller
        self._planner = Planner(task)
        self.q = task.start
        self.tick = 0

    def copy(self) -> 'Drive':
        other = copy.copy(self)
        other.controller = copy.copy(self.controller)
        other._planner = copy.copy(self._planner)
        return other

    def step(self) -> tuple[Command, np.ndarray]:
        """One tick: the command and the task velocity that it is for."""
        dx = self._planner.reference(self.controller.model.tip(self.q)[0], self.tick * T).dx
        command = self.controller.update(self.q, dx)
        self.q = command.q_ref
        self.tick = self.tick + 1
        return command, dx

    def run(self, seconds: float) -> list[Command]:
        return [self.step()[0] for _ in range(round(seconds / T))]


@pytest.fixture(scope='module')
def underway(model, task) -> Callable[[str, float], Drive]:
    """A drive under some law at some time [s] of the paper's task; each law is driven once."""
    kept: dict[tuple[str, float], Drive] = {}

    def at(law: str, time: float) -> Drive:
        if (law, time) not in kept:
            drive = Drive(controller_of(model, law, switch_time=SWITCH_TIME), task)
            for stop in (1.5, 4.5):
                drive.run(stop - drive.tick * T)
                kept[law, stop] = drive.copy()
        return kept[law, time].copy()

    return at


def test_the_reference_is_the_position_plus_one_tick_of_velocity(model, task):
    command = controller_of(model).update(task.start, DX)
    assert command.q_ref == pytest.approx(task.start + T * command.dq, abs=1e-15)  # footnote 1


def test_acceleration_and_torque_belong_to_the_step_in_velocity(model, task):
    controller = controller_of(model)
    first = controller.update(task.start, DX)
    second = controller.update(first.q_ref, DX)
    ddq = (second.dq - first.dq) / T  # Eq. (13)
    assert not first.state.dq_prev.any()
    assert (second.state.dq_prev == first.dq).all()
    assert second.ddq == pytest.approx(ddq, abs=1e-9)
    assert second.tau == pytest.approx(second.state.M @ ddq + second.state.n, abs=1e-9)  # Eq. (6)


def test_what_is_done_to_a_command_does_not_reach_the_controller(model, task):
    used = controller_of(model)
    untouched = controller_of(model)
    command = used.update(task.start, DX)
    expected = untouched.update(task.start, DX)
    for array in (
        command.dq,
        command.q_ref,
        command.null,
        command.state.q,
        command.state.dq_prev,
        command.J,
    ):
        array[:] = np.nan
    q = expected.q_ref
    assert (used.update(q, DX).q_ref == untouched.update(q, DX).q_ref).all()


@pytest.mark.parametrize('origin', ['command', 'measurement'])
@pytest.mark.parametrize('missed', [0, 1, 5])
def test_the_reference_goes_on_from_its_origin_over_missed_cycles(model, task, missed, origin):
    controller = controller_of(model, integrate_from=origin)
    first = controller.update(task.start, DX)
    bridged = first.q_ref + missed * T * first.dq
    measured = bridged - 1e-3  # a servo that hangs back
    second = controller.update(measured, DX, missed)
    expected = {'command': bridged, 'measurement': measured}[origin] + T * second.dq
    assert second.q_ref == pytest.approx(expected, abs=1e-15)


def test_a_callers_array_is_neither_kept_nor_handed_out(model, task):
    controller = controller_of(model, 'minimum_acceleration')
    q = task.start.copy()
    controller.hold_at(q)
    q += 0.1
    controller.reference[:] += 0.1
    np.testing.assert_array_equal(controller.reference, task.start)
    for wrong in (np.full(model.n, np.nan), np.zeros(3)):
        with pytest.raises(ArrayError, match='q_ref'):
            controller.hold_at(wrong)
    np.testing.assert_array_equal(controller.reference, task.start)


@pytest.mark.parametrize(('limits', 'dx'), [((), DX), (('acceleration',), 0.0 * DX)])
def test_after_reset_it_starts_from_the_measurement_at_rest(model, task, limits, dx):
    controller = controller_of(model, limits=limits)
    controller.reset()
    for _ in range(10):
        controller.update(task.start, dx)
    controller.reset()
    elsewhere = task.start + 0.1
    command = controller.update(elsewhere, DX)
    fresh = controller_of(model, limits=limits)
    assert (command.q_ref == fresh.update(elsewhere, DX).q_ref).all()


@pytest.mark.parametrize(
    ('options', 'words'),
    [
        ({'T': 0.0}, 'T is 0.0; allowed: 1e-05 to 1'),
        ({'T': np.nan}, 'T is nan'),
        ({'switch_time': -0.1}, 'switch_time is -0.1; allowed: 0 to 60'),
        ({'integrate_from': 'hope'}, "unknown integrate_from 'hope'; allowed: command, measure"),
        ({'robot_interface': 'tcp'}, "unknown robot_interface 'tcp'"),
        ({'scaling': 'component'}, "unknown scaling 'component'.*; allowed: components, task"),
        ({'limits': None}, 'limits is None; expected a list'),
        ({'preferences': 5}, 'preferences is 5; expected a list'),
        ({'limit_gains': None}, 'gains is None; expected a mapping'),
        ({'T': 0.0025}, r'damping is 401\.0; allowed: 0 to 400 .*1/T'),
    ],
)
def test_what_cannot_be_is_refused_at_construction(model, options, words):
    law = make_law('minimum_acceleration', damping=401.0)
    with pytest.raises(RedresError, match=words):
        Controller(model, law, **{'T': T, **options})


def test_too_much_damping_is_refused_at_a_switch_and_the_law_stays(model):
    controller = controller_of(model)
    with pytest.raises(RangeError, match=r'damping is 501\.0'):
        controller.switch_law(make_law('minimum_velocity', damping=501.0))
    assert controller.law == make_law('minimum_acceleration')


BAD = {
    'q nan': (np.full(7, np.nan), DX),
    'q short': (np.zeros(6), DX),
    'q column': (np.zeros((7, 1)), DX),
    'dx nan': (None, np.array((0.1, np.nan, 0.0))),
    'dx inf': (None, np.array((0.1, np.inf, 0.0))),
    'dx short': (None, np.zeros(2)),
    'dx column': (None, np.zeros((3, 1))),
    'dx beyond light': (None, np.full(3, 1e10)),
    'dx with an infinite norm': (None, np.full(3, -1e308)),
}


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize(('q', 'dx'), BAD.values(), ids=BAD)
def test_bad_input_leaves_the_controller_exactly_as_it_was(model, task, q, dx):
    disturbed = controller_of(model, switch_time=0.1)
    calm = controller_of(model, switch_time=0.1)
    for tick in range(80):  # the start, and a switch on the way
        for controller in (disturbed, calm):
            if tick == 40:
                controller.switch_law(make_law('minimum_kinetic_energy'))
        with pytest.raises((ArrayError, RangeError), match='q' if dx is DX else 'dx'):
            disturbed.update(task.start if q is None else q, dx)
        got = disturbed.update(task.start, DX)
        expected = calm.update(task.start, DX)
        assert (got.dq == expected.dq).all()
        assert (got.q_ref == expected.q_ref).all()


@PAIRS
def test_a_switch_executes_the_task_and_then_only_the_new_law_acts(underway, old, new):
    drive = underway(old, 4.5)
    law = make_law(new)
    drive.controller.switch_law(law)
    ticks = round(SWITCH_TIME / T)
    for tick in range(ticks + 3):
        command, dx = drive.step()
        # Rounding is relative to the motion in the null space, where minimum_torque has 80 rad/s.
        error = np.linalg.norm(command.J @ command.dq - dx)
        assert error < ROUNDING * (1.0 + 100.0 * np.linalg.norm(command.dq))
        assert tick < ticks or (command.dq == alone(law, command, dx)).all()


@pytest.mark.parametrize(
    ('old', 'new'), list(permutations(('minimum_velocity', 'minimum_kinetic_energy')))
)
def test_laws_without_memory_are_mixed_by_the_quintic(underway, old, new):
    drive = underway(old, 1.5)
    ticks = round(SWITCH_TIME / T)
    drive.controller.switch_law(make_law(new))
    for tick in range(1, 2 * ticks):
        command, dx = drive.step()
        s, _ = quintic(tick / ticks)
        of_old, of_new = (alone(make_law(name), command, dx) for name in (old, new))
        assert command.dq == pytest.approx((1.0 - s) * of_old + s * of_new, abs=ROUNDING)


def peak(commands: list[Command]) -> float:
    return max(np.linalg.norm(command.ddq) for command in commands)


@pytest.mark.slow
def test_a_switch_that_would_jump_needs_a_fraction_of_the_acceleration(underway):
    jumps = 0
    # which needs thousands of rad/s^2 by itself
    calm = [law for law in LAWS if law != 'minimum_torque']
    for (old, new), time in product(permutations(calm, 2), (1.5, 4.5)):
        staying, blended, at_once = (underway(old, time) for _ in range(3))
        at_once.controller.switch_time = 0.0
        for drive in (blended, at_once):
            drive.controller.switch_law(make_law(new))
        first, *after = at_once.run(SWITCH_TIME)
        by_themselves = max(peak(staying.run(SWITCH_TIME)), peak(after))
        if peak([first]) > 5.0 * by_themselves:
            jumps += 1
            highest = peak(blended.run(SWITCH_TIME))
            assert highest < 0.2 * peak([first]), f'{old} to {new} at {time} s'
    assert jumps > 10  # a third, most of them to a law without memory


@pytest.mark.parametrize('period', [0.001, 0.002, 0.01])
def test_a_self_motion_is_faded_out_over_the_switch_time_whatever_the_period(period):
    controller = Controller(
        FloatingArm(), make_law('minimum_acceleration', damping=0.0), period, switch_time=0.5
    )
    controller.switch_time = 0.0
    controller.update(np.zeros(7), np.zeros(3))
    controller.published = Published(np.zeros(7), np.ones(7), np.zeros(7), np.ones(7))
    controller.switch_time = 0.5  # underway at 1 rad/s
    controller.switch_law(make_law('minimum_velocity'))
    for k in range(1, round(0.5 / period)):
        s, _ = quintic(k * period / 0.5)
        assert controller.update(np.zeros(7), np.zeros(3)).dq == pytest.approx(1.0 - s, abs=1e-9)


def test_asking_for_the_law_in_force_changes_nothing(underway):
    drive = underway('minimum_acceleration', 4.5)
    asked = drive.copy()
    asked.controller.switch_law(make_law('minimum_acceleration'))
    for command, expected in zip(asked.run(0.1), drive.run(0.1), strict=True):
        assert (command.dq == expected.dq).all()


def test_of_many_switches_the_last_one_wins(underway):
    drive = underway('minimum_velocity', 1.5)
    random = np.random.default_rng(0)
    for _ in range(500):
        name = random.choice([law for law in LAWS if law != 'minimum_torque'])
        drive.controller.switch_law(make_law(name))
        assert np.linalg.norm(drive.step()[0].dq) < 20.0  # the laws by themselves: 5 rad/s
    last = make_law('minimum_kinetic_energy')
    drive.controller.switch_law(last)
    assert drive.controller.law == last
    drive.run(2 * SWITCH_TIME)  # the rest of a switch under way, and the last one
    command, dx = drive.step()
    assert (command.dq == alone(last, command, dx)).all()


MISSED = [('missed', given) for given in (None, -1, 1.5, float('nan'), float('inf'), 10**400)]
SHORT = Correction(np.zeros(3), np.zeros(2, bool), np.zeros(3))
PARTS = [('correction', 'x'), ('correction', SHORT), ('ahead', 'x'), ('ahead', np.zeros(3))]


@pytest.mark.parametrize(('name', 'given'), [*MISSED, *PARTS])
def test_what_a_tick_cannot_use_is_refused_by_name(model, task, name, given):
    controller = controller_of(model)
    first = controller.update(task.start, DX)
    with pytest.raises(RangeError if name == 'missed' else ArrayError, match=name):
        controller.update(first.q_ref, DX, **{name: given})
    assert np.isfinite(controller.update(first.q_ref, DX).q_ref).all()


def test_what_is_no_policy_is_refused(model):
    with pytest.raises(ArrayError, match='policy is None; expected a Policy'):
        controller_of(model).set_policy(None)


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize(
    ('change', 'words'),
    [
        (lambda q: np.ma.masked_array(q, mask=[True] + 6 * [False]), 'masked'),
        (lambda q: q.astype(str), '7 real numbers'),
        (lambda q: [10**400, *q[1:]], '7 real numbers'),
        (lambda q: None, 'has shape'),
    ],
    ids=['masked', 'text', 'too large', 'nothing'],
)
def test_positions_that_are_no_real_numbers_are_refused(model, task, change, words):
    with pytest.raises(ArrayError, match=words) as caught:
        controller_of(model).update(change(task.start), DX)
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize('name', LAWS)
def test_the_start_from_standing_still_does_not_jump(model, task, name):
    controller = Controller(model, make_law(name, damping=1.0 / T), T, switch_time=SWITCH_TIME)
    drive = Drive(controller, task)
    # s grows as 10 xi^3: after 20 of 250 ticks to 0.005. All laws together ask for 90 rad/s^2 at
    # once.
    assert peak(drive.run(20 * T)) < 0.05 * 90.0


@pytest.mark.slow
@pytest.mark.parametrize('name', LAWS)
def test_ticks_give_the_garbage_collector_no_reason_to_run(model, task, name):
    """Python looks for cycles once so many more objects were made than freed; a tick frees what it
    makes.
    """
    controller = Controller(model, make_law(name), 0.002)
    collections = []
    controller.update(task.start, DX)
    gc.collect()
    gc.callbacks.append(lambda phase, info: collections.append(phase))
    try:
        for _ in range(5 * gc.get_threshold()[0]):
            controller.update(task.start, DX)
    finally:
        gc.callbacks.pop()
    assert not collections


def test_a_command_is_printed_in_three_lines():
    model = RobotModel.named('fr3')
    controller = Controller(model, make_law('minimum_velocity'), T)
    command = controller.update(np.array(model.arm.start), np.array((0.1, 0.0, 0.0)))
    assert [line.split()[0] for line in str(command).splitlines()] == ['dq', 'q_ref', 's']
