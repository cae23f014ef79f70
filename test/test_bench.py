"""`redres bench`: right about what it is given, and complete. No test asks how fast this machine
is.
"""

import importlib.util
import json
import subprocess
import sys
import time

import numpy as np
import pytest

from redres_ros import LAWS
from redres_ros.bench import loop, peers
from redres_ros.bench.exchange import Exchange, ProcessorMeter, Stopwatch, processor_seconds
from redres_ros.bench.goals import Goal
from redres_ros.bench.loop_result import COMPOSED, CONTROLLER, ECHO, LoopResult
from redres_ros.bench.report import write_json
from redres_ros.bench.tick import SAME, TickResult, recorded
from redres_ros.bench.tick import T as TICK
from redres_ros.bench.timing import BLOCK, COLD, Times, measure
from redres_ros.bench.udp import Client, echo_process
from redres_ros.cli import main

PERIOD = 0.002  # [s]


def exchange(milliseconds: list[float], skipped: int = 0, share: float = 0.1) -> Exchange:
    return Exchange(
        PERIOD,
        np.array(milliseconds) / 1e3,
        dict.fromkeys((ECHO, CONTROLLER, COMPOSED), share),
        skipped,
    )


def times(*microseconds: float) -> Times:
    return Times(np.array(microseconds) / 1e6)


# --- statistics -----------------------------------------------------------------------------------


def test_quantiles_are_samples_that_occurred():
    samples = Times(np.random.default_rng(0).permutation(np.arange(1.0, 1001.0)))
    assert samples.median == 501.0
    assert samples.p99 == 991.0
    assert samples.quantile(1.0) == 1000.0
    assert np.isnan(Times(np.array([])).median)


def test_calls_take_turns_in_changing_order_and_get_the_number_of_their_turn():
    seen = []
    rounds = 20
    result = measure({name: lambda k, name=name: seen.append((name, k)) for name in 'abc'}, rounds)
    blocks = [name for name, _ in seen[::BLOCK]]
    assert [name for name, _ in seen] == [name for name in blocks for _ in range(BLOCK)]
    turns = {''.join(blocks[i : i + 3]) for i in range(0, len(blocks), 3)}
    assert all(sorted(turn) == ['a', 'b', 'c'] for turn in turns) and len(turns) > 3
    assert [k for name, k in seen if name == 'a'][BLOCK:] == list(range(rounds * BLOCK))
    assert {name: len(t.samples) for name, t in result.items()} == dict.fromkeys(
        'abc', rounds * (BLOCK - COLD)
    )


def test_what_takes_longer_is_measured_as_longer():
    result = measure({'sleep': lambda k: time.sleep(0.002), 'nothing': lambda k: None}, rounds=1)
    assert result['sleep'].median >= 0.002 > result['nothing'].median


def test_a_goal_that_could_not_be_measured_is_not_held():
    assert Goal('a', 1.0, 2.0).held and not Goal('a', 3.0, 2.0).held
    assert Goal('a', 3.0, 2.0, at_most=False).held
    assert (
        not Goal('a', float('nan'), 2.0).held
        and not Goal('a', float('nan'), 2.0, at_most=False).held
    )


# --- late, lost and skipped -----------------------------------------------------------------------


def test_late_lost_and_skipped_cycles_are_told_apart():
    some = exchange([0.5, 1.0, 2.5, np.inf], skipped=1)
    assert (some.late, some.lost, some.kept) == (0.5, 0.25, 0.4)
    assert sorted(some.times.samples) == pytest.approx([0.5e-3, 1e-3, 2.5e-3])
    assert some.figures()['answered_in_cycle_percent'] == 50.0


def test_repetitions_are_weighed_by_their_states():
    both = Exchange.joined(
        [exchange([1.0, 1.0, 1.0], share=0.1), exchange([3.0], skipped=2, share=0.5)]
    )
    assert (both.late, both.skipped) == (0.25, 2)
    assert both.processors[ECHO] == pytest.approx(0.2)


def test_a_stopwatch_keeps_to_its_ticks_and_to_first_answers(monkeypatch: pytest.MonkeyPatch):
    now = iter([0.0, 0.001, 0.004, 0.009])
    monkeypatch.setattr(time, 'perf_counter', lambda: next(now))
    watch = Stopwatch(10, 4)
    watch.out(9)  # outside
    watch.out(10)  # at 0 ms
    watch.back(10)  # at 1 ms
    watch.back(10)  # again: does not count
    watch.out(11)  # at 4 ms: one cycle was skipped; never answered
    watch.back(13)  # at 9 ms: to a state that did not go out
    assert watch.latencies.tolist() == [0.001, np.inf]
    assert watch.exchange(PERIOD, {}).skipped == 1


def test_processor_time_is_that_of_the_process():
    program = 'import time\nwhile time.process_time() < 0.3: pass\nprint(flush=True)\ninput()'
    with subprocess.Popen(
        [sys.executable, '-c', program], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        meter = ProcessorMeter({'it': process.pid})
        process.stdout.readline()
        assert processor_seconds(process.pid) >= 0.25
        assert 0.0 < meter.shares()['it'] <= 1.1
        process.stdin.close()
    assert np.isnan(processor_seconds(process.pid))


def test_the_udp_echo_returns_what_it_gets():
    answers = []
    with echo_process() as (_, port):
        client = Client(port, 300, answers.append)
        for number in (7, 8):
            client.send(number)
        until = time.monotonic() + 10.0
        while len(answers) < 2 and time.monotonic() < until:
            time.sleep(0.01)
    assert answers == [7, 8]


# --- goals and tables -----------------------------------------------------------------------------


def test_the_loops_goals_compare_with_the_echo_of_the_same_rate():
    kinds = {
        ECHO: exchange([1.0, 1.0]),
        CONTROLLER: exchange([1.2, 2.4], share=0.3),
        COMPOSED: exchange([0.5, 0.5]),
    }
    result = LoopResult({500.0: kinds, 1000.0: kinds})
    held = {goal.what: goal.held for goal in result.goals()}
    assert held == {
        "controller, minimum_acceleration at 500 Hz: median by the echo's": False,
        "controller, minimum_acceleration at 500 Hz: late cycles by the echo's": False,
        'controller, minimum_acceleration at 500 Hz: percent of a core': False,
        'in one process at 500 Hz: percent late': True,
        "in one process at 500 Hz: median by the two-process echo's": True,
        "controller, minimum_acceleration at 1000 Hz: median by the echo's": False,
        "controller, minimum_acceleration at 1000 Hz: late cycles by the echo's": False,
        'controller, minimum_acceleration at 1000 Hz: percent answered in the cycle': False,
    }
    assert result.table().count('bare echo node') == 2


def test_only_peers_that_solve_the_same_problem_count():
    laws = dict.fromkeys(LAWS, times(10.0))
    floors = {'computeAllTerms': times(5.0)}
    result = TickResult(
        laws,
        {},
        floors,
        {'quick': times(1.0), 'right': times(40.0)},
        {'quick': 2.0 * SAME, 'right': 0.0},
        (),
    )
    assert result.fastest_peer == 'right'
    assert all(goal.held for goal in result.goals())
    assert 'does not count' in result.table()


def test_without_peers_there_are_still_the_goals_of_the_floor():
    result = TickResult(
        dict.fromkeys(LAWS, times(10.0)),
        {},
        {'computeAllTerms': times(5.0)},
        {},
        {},
        ('pink', 'mink'),
    )
    assert len(result.goals()) == len(LAWS)
    assert 'none installed' in result.table()


def test_the_file_of_results_is_json_where_numbers_are_missing_too(tmp_path):
    write_json({'loop': LoopResult({500.0: {ECHO: exchange([np.inf])}})}, tmp_path / 'bench.json')
    content = json.loads((tmp_path / 'bench.json').read_text(), parse_constant=pytest.fail)
    assert content['loop']['500_Hz'][ECHO]['median_us'] is None
    assert content['machine']['versions']['numpy']


# --- what is measured -----------------------------------------------------------------------------


def test_the_stretch_is_the_beginning_of_the_task(model, task):
    stretch = recorded(model, 100)
    assert (stretch.q[0] == task.start).all()
    assert np.allclose(stretch.q[1:], stretch.q[:-1] + TICK * stretch.dq_prev[1:], atol=1e-12)
    assert np.abs(stretch.x_d[-1] - model.tip(stretch.q[-1])[0]).max() < 0.01


@pytest.mark.parametrize('name', ['pink', 'mink'])
@pytest.mark.parametrize('solver', peers.SOLVERS)
def test_a_peer_has_the_same_arm_and_executes_the_same_task(name, solver, model):
    if {name, solver} & set(peers.missing_peers()):
        pytest.skip(f'{name} with {solver} is not installed')
    stretch = recorded(model, 50)
    some = peers.peers(model.arm, TICK)
    for label in (f'{name}, {solver}', f'{name}, {solver}, no limits'):
        for q, _, dx, x_d in zip(*stretch, strict=True):
            dq = some[label](q, x_d)
            assert np.abs(model.state(q, dq).J @ dq - dx).max() < 1e-3


def test_the_floor_is_the_jacobian_that_the_laws_get(model, states):
    for _, call in peers.floors(model.arm):
        assert np.allclose(call(states[0].q, states[0].dq_prev)[:3], states[0].J, atol=1e-12)


# --- the command ----------------------------------------------------------------------------------


def test_a_short_bench_is_complete(tmp_path, capsys):
    assert main(['bench', '--only', 'tick', '--duration', '0.01', '--out', str(tmp_path)]) == 0
    out = capsys.readouterr().out
    content = json.loads((tmp_path / 'bench.json').read_text())
    assert set(content) == {'machine', 'tick', 'goals'}
    assert set(content['tick']['laws']) == set(LAWS)
    assert all(entry['median_us'] > 0.0 for entry in content['tick']['parts'].values())
    for word in ('dynamically_consistent', 'computeAllTerms', 'goals:'):
        assert word in out or word in json.dumps(content)


@pytest.mark.realtime
def test_a_short_loop_has_every_kind(tmp_path, monkeypatch):
    monkeypatch.setattr(loop, 'REPETITIONS', 1)
    monkeypatch.setattr(loop, 'SETTLING', 0.1)
    assert (
        main(
            [
                'bench',
                '--only',
                'loop',
                '--duration',
                '0.2',
                '--rates',
                '100',
                '--out',
                str(tmp_path),
            ]
        )
        == 0
    )
    kinds = json.loads((tmp_path / 'bench.json').read_text())['loop']['100_Hz']
    assert set(kinds) == {'udp', 'echo', 'inside', 'controller', 'graph', 'composed'}
    assert all(figures['states'] >= 10 and figures['median_us'] > 0.0 for figures in kinds.values())
    assert set(kinds['graph']['processor_percent_of_a_core']) == {'sim', 'planner', 'controller'}


@pytest.mark.skipif(importlib.util.find_spec('pink') is not None, reason='peers are installed')
def test_missing_peers_are_named_with_the_remedy(tmp_path, capsys):
    assert main(['bench', '--only', 'tick', '--duration', '0.01', '--out', str(tmp_path)]) == 0
    assert "pip install 'redres_ros[bench]'" in capsys.readouterr().out


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
