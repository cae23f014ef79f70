"""From the nodes' tapes to a table and a summary: what is written is read, and counted right."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from geometry_msgs.msg import PoseStamped
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Int32, String

from redres_ros.controller import Controller
from redres_ros.demo.cycles import CycleCounts, count_cycles
from redres_ros.demo.log import Log, read_log
from redres_ros.demo.outcome import MotionFigures, Outcome
from redres_ros.demo.replay import replay
from redres_ros.demo.tape import Entry, Tape, read_tape, stamp_of, stamped
from redres_ros.laws import make_law
from redres_ros.nodes.stamps import to_time
from redres_ros.planner import Planner
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.recording import Recording, columns
from redres_ros.waypoints import load_task

T = 0.002  # [s]
PERIOD = 2_000_000  # [ns]
NAMES = RobotModel.named('lwr4_paper').joint_names
MS = 1_000_000  # [ns]


def joint_state(tick: int, q: Any = (), dq: Any = ()) -> JointState:
    message = JointState(name=NAMES, position=list(q), velocity=list(dq))
    message.header.stamp = to_time(tick * PERIOD)
    return message


def pose(tick: int, x: Any) -> PoseStamped:
    message = PoseStamped()
    message.header.stamp = to_time(tick * PERIOD)
    message.pose.position.x, message.pose.position.y, message.pose.position.z = map(float, x)
    return message


def log_of(**given: Any) -> Log:
    empty: dict[str, Any] = {name: {} for name in Log.__dataclass_fields__ if name != 'session'}
    return Log(**{**empty, 'session': (), **given})


# --- the file -------------------------------------------------------------------------------------


def test_what_was_written_is_read_in_its_order(tmp_path: Path) -> None:
    tape = Tape(tmp_path / 'tape')
    tape.write('joint_states', joint_state(5, np.arange(7.0)), heard=False)
    tape.write('joint_command', joint_state(5, -np.arange(7.0)), heard=True)
    tape.close()
    state, command = read_tape(tmp_path / 'tape')
    assert (state.topic, state.heard, command.topic, command.heard) == (
        'joint_states',
        False,
        'joint_command',
        True,
    )
    assert list(state.message.position) == list(range(7))
    assert list(command.message.position) == [-i for i in range(7)]
    assert state.time < command.time


def test_a_tape_whose_writer_was_killed_is_read_up_to_the_last_whole_message(
    tmp_path: Path,
) -> None:
    path = tmp_path / 'tape'
    tape = Tape(path)
    for tick in range(3):
        tape.write('joint_states', joint_state(tick), heard=False)
    tape.close()
    whole = path.read_bytes()
    for cut in (1, 10, len(whole) // 3 - 1):
        path.write_bytes(whole[:-cut])
        assert len(list(read_tape(path))) == 2


def test_a_message_without_a_stamp_belongs_to_the_newest_stamp_before_it(tmp_path: Path) -> None:
    tape = Tape(tmp_path / 'tape')
    tape.write('planner/state', String(data='idle'), heard=False)
    tape.write('planner/desired_pose', pose(7, (1, 2, 3)), heard=False)
    tape.write('planner/segment', Int32(data=2), heard=False)
    tape.close()
    got = [stamp for stamp, _ in stamped(read_tape(tmp_path / 'tape'))]
    assert got == [0, 7 * PERIOD, 7 * PERIOD]


def test_what_comes_long_after_the_last_stamp_that_counts_is_not_even_read():
    def entries() -> Iterator[Entry]:
        for tick in (1, 3, 2, 10**6):  # two of them in disorder
            message = joint_state(0)
            message.header.stamp = to_time(tick * PERIOD)
            yield Entry(0, 'joint_states', False, serialize_message(message))
        raise AssertionError('read on')

    got = [stamp for stamp, _ in stamped(entries(), until=2.0 * PERIOD)]
    assert got == [PERIOD, 2 * PERIOD]


def test_a_stamp_is_found_without_reading_the_message() -> None:
    message = joint_state(0)
    message.header.stamp = to_time(1_763_712_345 * 10**9 + 987_654_321)
    assert stamp_of(serialize_message(message)) == 1_763_712_345 * 10**9 + 987_654_321


# --- cycles ---------------------------------------------------------------------------------------


def exchange(*times: tuple[float, float | None]) -> list[Entry]:
    """A tape of states that went out and answers that came at some times [ms], by tick."""
    entries = []
    for tick, (sent, answered) in enumerate(times):
        data = serialize_message(joint_state(tick))
        entries.append(Entry(int(sent * MS), 'joint_states', False, data))
        if answered is not None:
            entries.append(Entry(int(answered * MS), 'joint_command', True, data))
    return entries


def test_every_cycle_is_counted_as_one_of_four() -> None:
    tape = exchange(
        (0.0, 1.0),  # in time
        (2.0, 5.0),  # late: the next state went out at 4
        (4.0, None),  # never answered
        (6.0, 9.0),  # the clock waited
        (9.5, 10.0),  # in time
    )
    assert count_cycles(tape, T, (0, 4 * PERIOD)) == CycleCounts(
        in_time=2, waited_for=1, late=1, missed=1, stood_still=pytest.approx(0.0015)
    )


def test_cycles_before_and_after_the_task_do_not_count() -> None:
    tape = exchange((0.0, 1.0), (2.0, None), (4.0, 5.0), (6.0, None))
    cycles = count_cycles(tape, T, (PERIOD, 2 * PERIOD))
    assert (cycles.total, cycles.in_time, cycles.missed) == (2, 1, 1)


def test_in_lock_step_there_is_no_clock_to_be_late_for() -> None:
    cycles = count_cycles(exchange((0.0, 50.0), (60.0, 61.0)), np.inf, (0, PERIOD))
    assert cycles == CycleCounts(in_time=2, waited_for=0, late=0, missed=0, stood_still=0.0)


# --- the log --------------------------------------------------------------------------------------


def test_rounds_are_what_the_planner_moved_through_until_the_robot_stopped() -> None:
    words = {10: 'moving', 13: 'finished', 20: 'moving'}
    log = log_of(
        states=dict.fromkeys(range(30)),
        desired=dict.fromkeys([*range(10, 16), *range(20, 26)]),
        words=words,
        reasons={0: '', 22: 'a reason'},
    )
    assert log.rounds() == [[10, 11, 12], [20, 21, 22]]
    assert log.under_way() == [10, 11, 12, 20, 21, 22]
    assert (log.stopped_at, log.reason) == (22, 'a reason')


def test_a_state_that_the_planner_missed_is_part_of_the_motion() -> None:
    log = log_of(
        states=dict.fromkeys(range(10, 15)),
        desired={10: np.zeros(7), 13: np.full(7, 0.3)},
        words={10: 'moving'},
    )
    assert log.under_way() == [10, 11, 12, 13]
    np.testing.assert_allclose(log.desired_at([11, 12]), [[0.1] * 7, [0.2] * 7])


def test_a_switch_is_told_with_both_names_and_when() -> None:
    log = log_of(
        states=dict.fromkeys([0, PERIOD, 2 * PERIOD, 3 * PERIOD]),
        desired=dict.fromkeys([0, PERIOD, 2 * PERIOD, 3 * PERIOD]),
        words={0: 'moving'},
        laws={0: 'one', 2 * PERIOD: 'two'},
    )
    assert log.switches() == ((0.004, 'one', 'two'),)


# --- the table ------------------------------------------------------------------------------------


@pytest.fixture(scope='module')
def rows_and_tape(tmp_path_factory: pytest.TempPathFactory) -> tuple[Recording, Path, RobotModel]:
    """The beginning of an ideal loop: its own table, and what nodes would have said of it."""
    from redres_ros.simulation.recording import row

    model = RobotModel.named('lwr4_paper')
    task = load_task('rectangle')
    controller = Controller(model, make_law('dynamically_consistent'), T)
    planner = Planner(task)
    path = tmp_path_factory.mktemp('tape') / 'tape'
    tape = Tape(path)
    q = task.start
    rows = []
    for k in range(200):
        reference = planner.reference(model.tip(q)[0], k * T)
        command = controller.update(q, reference.dx)
        rows.append(row(k * T, command, reference))
        tick = k + 1000
        tape.write('joint_states', joint_state(tick, q), heard=False)
        tape.write('joint_command', joint_state(tick, command.q_ref, command.dq), heard=True)
        tape.write('controller/law', String(data='dynamically_consistent'), heard=False)
        tape.write('planner/desired_pose', pose(tick, reference.x_d), heard=False)
        tape.write('planner/segment', Int32(data=reference.segment), heard=False)
        if k == 0:
            tape.write('planner/state', String(data='moving'), heard=False)
        q = command.q_ref
    tape.close()
    return Recording.of(rows, model.n, T, False, ''), path, model


def test_the_table_from_a_tape_is_that_of_the_loop(
    rows_and_tape: tuple[Recording, Path, RobotModel],
) -> None:
    expected, path, model = rows_and_tape
    got = replay(read_log([path], model.joint_names), model, make_law, T)
    assert len(got.data) == len(expected.data)
    for name in columns(model.n):
        np.testing.assert_allclose(got[name], expected[name], rtol=1e-9, atol=1e-9, err_msg=name)


def test_the_figures_of_a_motion_are_those_of_its_rows(
    rows_and_tape: tuple[Recording, Path, RobotModel],
) -> None:
    recording, _, _ = rows_and_tape
    task = load_task('rectangle')
    motion = MotionFigures.of(recording, task, 0.1)
    assert motion.error[0] == recording['task_error'].max()
    aside = recording.vectors('x')[:, (0, 2)] - task.waypoints[0, (0, 2)]  # from a way along y
    assert motion.aside[0] == pytest.approx(np.linalg.norm(aside, axis=1).max())
    assert motion.seconds == pytest.approx(199 * T)
    dq = recording.vectors('dq1')
    assert motion.jump == pytest.approx(np.abs(np.diff(dq[:51], axis=0, prepend=0.0)).max())
    still = recording['joint_velocity_norm'] <= 1e-4
    assert motion.still == pytest.approx(T * still.sum())
    assert motion.delay == pytest.approx(recording['t'][np.argmin(still)])


def test_a_run_that_ended_early_did_not_succeed(
    rows_and_tape: tuple[Recording, Path, RobotModel],
) -> None:
    recording, _, _ = rows_and_tape
    finished = Recording(recording.data, 7, T, True, '')
    good = {'motion': None, 'cycles': None, 'session': ()}
    assert Outcome(finished, **good, stop_reason='').succeeded
    assert not Outcome(recording, **good, stop_reason='').succeeded
    assert not Outcome(finished, **good, stop_reason='a reason').succeeded
    assert not Outcome(finished, **good, stop_reason='', interrupted=True).succeeded
