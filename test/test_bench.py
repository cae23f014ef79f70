"""`redres bench`: right about what it is given, and complete. No test asks how fast this machine
is.
"""

import importlib.util
import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from redres_ros import LAWS, RobotModel
from redres_ros.bench import loop, peers
from redres_ros.bench.loop import (
    LoopResult,
    ProcessorMeter,
    graphs,
    processor_seconds,
    round_trips,
)
from redres_ros.bench.tick import (
    LIMITED,
    SAME,
    TickResult,
    controllers,
    deviation,
    recorded,
)
from redres_ros.bench.tick import T as TICK
from redres_ros.bench.timing import BLOCK, COLD, RoundTrips, Times, measure
from redres_ros.cli import main
from redres_ros.cli.bench import write_results
from redres_ros.graph.mcap_file import RecordedMessage
from redres_ros.nodes.wire import to_time

PERIOD = 0.002  # [s]


def trips(milliseconds: list[float], skipped: int = 0, share: float = 0.1) -> RoundTrips:
    return RoundTrips(PERIOD, np.array(milliseconds) / 1e3, skipped, {'node': share})


def times(*microseconds: float) -> Times:
    return Times(np.array(microseconds) / 1e6)


def tick_result(**others: tuple[float, float]) -> TickResult:
    """Laws of 10 us, a floor of 5 us, and peers by their median [us] and deviation [rad/s]."""
    return TickResult(
        dict.fromkeys(LAWS, times(10.0)),
        {'computeAllTerms': times(5.0)},
        {name: times(median) for name, (median, _) in others.items()},
        {name: off for name, (_, off) in others.items()},
        (),
    )


# --- statistics -----------------------------------------------------------------------------------


def test_quantiles_are_samples_that_occurred() -> None:
    samples = Times(np.random.default_rng(0).permutation(np.arange(1.0, 1001.0)))
    assert samples.median == 501.0
    assert samples.p99 == 991.0
    assert samples.quantile(1.0) == 1000.0
    assert np.isnan(Times(np.array([])).median)


def test_calls_take_turns_in_changing_order_and_get_the_number_of_their_turn() -> None:
    seen = []
    rounds = 20
    result = measure({name: lambda k, name=name: seen.append((name, k)) for name in 'abc'}, rounds)
    blocks = [name for name, _ in seen[::BLOCK]]
    assert [name for name, _ in seen] == [name for name in blocks for _ in range(BLOCK)]
    turns = {''.join(blocks[i : i + 3]) for i in range(0, len(blocks), 3)}
    assert all(sorted(turn) == ['a', 'b', 'c'] for turn in turns)
    assert len(turns) > 3
    assert [k for name, k in seen if name == 'a'][BLOCK:] == list(range(rounds * BLOCK))
    counted = rounds * (BLOCK - COLD)
    assert {name: len(t.samples) for name, t in result.items()} == dict.fromkeys('abc', counted)


def test_what_takes_longer_is_measured_as_longer() -> None:
    result = measure({'sleep': lambda k: time.sleep(0.002), 'nothing': lambda k: None}, rounds=1)
    assert result['sleep'].median >= 0.002 > result['nothing'].median


# --- late, lost and skipped -----------------------------------------------------------------------


def test_late_lost_and_skipped_cycles_are_counted_apart() -> None:
    some = trips([0.5, 1.0, 2.5, np.inf], skipped=1)
    assert (some.in_cycle, some.lost) == (0.5, 0.25)
    assert sorted(some.times.samples) == pytest.approx([0.5e-3, 1e-3, 2.5e-3])
    assert some.figures()['in_cycle_percent'] == 50.0


def test_repetitions_are_weighed_by_their_states() -> None:
    both = RoundTrips.joined(
        [trips([1.0, 1.0, 1.0], share=0.1), trips([3.0], skipped=2, share=0.5)]
    )
    assert (both.in_cycle, both.skipped) == (0.75, 2)
    assert both.processors['node'] == pytest.approx(0.2)


def test_a_pause_of_the_robot_is_skipped_cycles() -> None:
    sent = [0.0, 0.002, 0.008, 0.010]
    assert RoundTrips.from_times(PERIOD, sent, [np.inf] * 4, {}).skipped == 2
    assert RoundTrips.from_times(PERIOD, [], [], {}).skipped == 0


def test_a_recording_gives_the_first_commands_for_the_states_of_its_window() -> None:
    messages = []
    for milliseconds, tick, is_received in (
        (0, 1, False),  # before the window
        (1, 1, True),
        (10, 2, False),
        (11, 2, True),
        (13, 2, True),  # again: does not count
        (14, 3, False),  # one cycle was skipped; no command
        (15, 9, True),  # to a state that never went out
        (30, 4, False),  # after the window
    ):
        message = JointState()
        message.header.stamp = to_time(tick)
        topic = '/joint_command' if is_received else '/joint_states'
        data = serialize_message(message)
        at = milliseconds * 10**6
        kind = 'sensor_msgs/msg/JointState'
        messages.append(RecordedMessage(topic, kind, data, at, at, is_received))
    got = round_trips(PERIOD, messages, (0.005, 0.025), {})
    assert got.latencies == pytest.approx([0.001, np.inf])
    assert got.skipped == 1


def test_processor_time_is_that_of_the_process() -> None:
    program = 'import time\nwhile time.process_time() < 0.3: pass\nprint(flush=True)\ninput()'
    with subprocess.Popen(
        [sys.executable, '-c', program], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        meter = ProcessorMeter({'it': process.pid})
        process.stdout.readline()
        assert processor_seconds(process.pid) >= 0.25
        assert 0.0 < meter.fractions()['it'] <= 1.1
        process.stdin.close()
    assert np.isnan(processor_seconds(process.pid))


# --- results --------------------------------------------------------------------------------------


def test_only_peers_that_solve_the_same_problem_count() -> None:
    result = tick_result(quick=(1.0, 2.0 * SAME), right=(40.0, 0.0))
    assert result.fastest_peer == 'right'


def test_without_peers_there_is_still_the_floor(capsys: pytest.CaptureFixture[str]) -> None:
    from redres_ros.simulation.report import print_tables

    result = tick_result()
    assert result.fastest_peer == ''
    print_tables(result.table())
    row = next(line for line in capsys.readouterr().out.splitlines() if 'minimum_torque' in line)
    assert row.split() == ['minimum_torque', '10.0', '10.0', '2.00']


def test_the_file_of_results_is_json_where_numbers_are_missing_too(tmp_path: Path) -> None:
    result = LoopResult({500.0: {'echo': trips([np.inf])}})
    write_results({'loop': result}, tmp_path / 'bench.json')
    content = json.loads((tmp_path / 'bench.json').read_text(), parse_constant=pytest.fail)
    assert content['loop']['500_Hz']['echo']['median_us'] is None
    assert content['machine']['versions']['numpy'] == np.__version__


# --- what is measured -----------------------------------------------------------------------------


def test_the_stretch_is_the_beginning_of_the_task(model, task):
    stretch = recorded(model, 100)
    assert (stretch.q[0] == task.start).all()
    assert np.allclose(stretch.q[1:], stretch.q[:-1] + TICK * stretch.dq_prev[1:], atol=1e-12)
    assert np.abs(stretch.x_d[-1] - model.tip(stretch.q[-1])[0]).max() < 0.01


def test_limits_act_in_the_one_and_not_in_the_other(model: RobotModel) -> None:
    """Not where the stretch begins again, either: it goes from rest to rest."""
    stretch = recorded(model)
    twice = 2 * list(zip(stretch.q, stretch.dx, strict=True))
    acting = {}
    for name, controller in controllers(model).items():
        if 'limits' in name:
            commands = [controller.update(q, dx) for q, dx in twice]
            acting[name] = float(np.mean([bool(command.active_limits) for command in commands]))
    assert acting['minimum_velocity, limits idle'] == 0.0
    assert acting['minimum_velocity, torque limits idle'] == 0.0
    assert acting['minimum_velocity, limits acting'] > 0.5


@pytest.mark.parametrize('name', ['embodik', 'roboplan', 'pink', 'mink'])
def test_a_peer_gives_the_velocities_of_the_least_velocity_law(
    name: str, model: RobotModel
) -> None:
    if name in peers.missing_peers():
        pytest.skip(f'{name} is not installed')
    stretch = recorded(model, 50)
    mine = {
        label: peer for label, peer in peers.peers(model.arm, TICK, 0.05).items() if name in label
    }
    assert mine
    for label, peer in mine.items():
        # One that stops earlier, and those that leave the path otherwise where limits act; the
        # bench says so of each run.
        if 'proxqp' not in label and 'acting' not in label:
            assert deviation(peer, model, stretch) < SAME, label


def test_a_peer_with_another_solution_is_found_out(model: RobotModel) -> None:
    stretch = recorded(model, 50)
    assert deviation(lambda q, x_d, dx: np.full(7, 0.5), model, stretch) > SAME


def test_the_floor_is_the_jacobian_that_the_laws_get(model, states):
    for call in peers.floors(model.arm).values():
        assert np.allclose(call(states[0].q, states[0].dq_prev)[:3], states[0].J[:3], atol=1e-12)


# --- the command ----------------------------------------------------------------------------------


@pytest.mark.nightly
def test_a_short_bench_of_the_tick_has_every_law_and_prints_what_it_writes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(['bench', '--only', 'tick', '--duration', '0.01', '--out', str(tmp_path)]) == 0
    out = capsys.readouterr().out
    content = json.loads((tmp_path / 'bench.json').read_text())
    assert set(content) == {'machine', 'tick'}
    limited = {f'minimum_velocity, {name}' for name in (*LIMITED, 'two priorities')}
    assert set(content['tick']['laws']) == {*LAWS, *limited}
    for name, figures in content['tick']['laws'].items():
        rows = [line.strip() for line in out.splitlines()]
        row = next(row for row in rows if row.startswith(f'{name}  '))
        median = row.removeprefix(name).split()[0]
        assert float(median) == pytest.approx(figures['median_us'], abs=0.06)  # to one decimal


@pytest.mark.nightly
@pytest.mark.realtime
def test_a_short_bench_of_the_loop_has_every_kind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(loop, 'REPETITIONS', 1)
    monkeypatch.setattr(loop, 'SETTLING', 0.1)
    short = ['--only', 'loop', '--duration', '0.6', '--rates', '100']
    assert main(['bench', *short, '--out', str(tmp_path)]) == 0
    kinds = json.loads((tmp_path / 'bench.json').read_text())['loop']['100_Hz']
    assert set(kinds) == set(graphs())
    for name, figures in kinds.items():
        assert figures['states'] > 0, name
        assert figures['median_us'] > 0.0, name
    for name, processes in graphs().items():
        assert set(kinds[name]['processor_percent_of_a_core']) == set(processes)


@pytest.mark.skipif(importlib.util.find_spec('pink') is not None, reason='peers are installed')
def test_missing_peers_are_named_with_the_remedy(tmp_path, capsys):
    assert main(['bench', '--only', 'tick', '--duration', '0.01', '--out', str(tmp_path)]) == 0
    out = capsys.readouterr().out
    # the extra, or under colcon the names on PyPI, where `pink` is another package
    assert "pip install 'redres_ros[bench]'" in out or ' pin-pink' in out


@pytest.mark.parametrize(
    'options',
    [
        ('--only', 'tick,nonsense'),
        ('--duration', '0'),
        ('--duration', 'nan'),
        ('--rates', '500,fast'),
        ('--rates', '5'),
    ],
)
def test_what_cannot_be_measured_is_refused_in_one_line(options, tmp_path, capsys):
    assert main(['bench', '--out', str(tmp_path), *options]) == 1
    assert len(capsys.readouterr().err.splitlines()) == 1
