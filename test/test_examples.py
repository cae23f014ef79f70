"""Every script in examples/ runs, and shows what it says."""

import json
import math
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest
from printed import differences
from programs import run_python

EXAMPLES = Path(__file__).resolve().parents[1] / 'examples'

pytestmark = pytest.mark.slow


def run(name: str, *arguments: str) -> str:
    done = run_python(EXAMPLES / f'{name}.py', *arguments, cwd=EXAMPLES.parent)
    assert done.returncode == 0, done.stderr
    return done.stdout


@contextmanager
def started(directory: Path, **nodes: dict[str, Any]) -> Iterator[None]:
    """Nodes with parameters, as processes in a domain of their own."""
    pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')
    from redres_ros.demo.processes import NodeProcess
    from redres_ros.nodes.runtime import own_domain

    with ExitStack() as stack:
        stack.enter_context(own_domain())
        for name, parameters in nodes.items():
            stack.callback(NodeProcess(name, directory / f'{name}.log', parameters).end)
        yield


def numbers(text: str) -> list[float]:
    return [float(number) for number in re.findall(r'-?\d+\.\d*|-?\d+', text)]


def test_the_first_motion_moves_the_tip_where_it_was_commanded() -> None:
    way, _ = run('first_motion').splitlines()
    # Its 2 s with 0.1 m/s; a step of T errs by a millionth of a metre.
    assert numbers(way) == pytest.approx([0.0, -0.2, 0.0], abs=1e-3)


def test_two_laws_are_compared() -> None:
    velocity, acceleration = run('compare_two_laws').splitlines()
    assert numbers(acceleration)[0] < 0.2 * numbers(velocity)[0]


def test_the_law_of_ones_own_spares_the_joint_that_it_is_to_spare() -> None:
    plain, own = run('own_law').splitlines()
    assert own.startswith('WristFirst')
    assert numbers(own)[0] < 0.6 * numbers(plain)[0]


def test_a_sensor_of_ones_own_moves_the_elbow_and_not_the_tip() -> None:
    clearance, moved = numbers(run('own_sensor'))
    assert clearance == pytest.approx(100.0, abs=5.0)
    assert moved < 0.1  # 20 mm/s of the elbow, and a step of T errs by some micrometres


def test_within_limits_the_joints_are_asked_for_what_they_have() -> None:
    without, within = run('within_limits').splitlines()
    count, share, *_ = numbers(without)
    assert (count, share > 100.0) == (0, True)
    count, share, *_ = numbers(within)
    assert (count, share <= 100.01) == (3, True)  # 100 % and rounding


@pytest.mark.realtime
def test_a_node_of_ones_own_moves_the_robot(tmp_path: Path) -> None:
    with started(tmp_path, sim={'patience': 60.0}):
        [height] = numbers(run('law_behind_your_node'))
    # Half a period of the sine: 0.05 m/s * 2 / pi.
    assert height == pytest.approx(0.032, abs=0.005)


@pytest.mark.realtime
def test_a_learned_policy_leads_the_tip_round_its_circle(tmp_path: Path) -> None:
    slow: dict[str, Any] = {'rate': 100.0}
    with started(tmp_path, sim=slow | {'patience': 60.0}, controller=slow, planner=slow):
        t, moved, _ = numbers(run('learned_policy'))
    # Pieces are a millimetre off, and a tip that begins in motion is some time behind.
    assert moved == pytest.approx(50.0 * math.sin(t), abs=8.0)


@pytest.mark.parametrize('name', ['learned_policy', 'visual_servoing'])
def test_a_client_of_a_robot_that_stops_fails_and_says_why(name: str, tmp_path: Path) -> None:
    from graph_helpers import await_that

    sim = {'patience': 60.0, 'acceleration_limit': (0.5,) * 7}
    controller = {'limits': ('none',)}
    says = pytest.raises(AssertionError, match='mode mirroring, sim/stop_reason protective stop')
    with started(tmp_path, sim=sim, controller=controller, planner={'autostart': True}), says:
        await_that(lambda: 'protective' in (tmp_path / 'sim.log').read_text(), 'the stop')
        run(name)


@pytest.mark.parametrize('name', ['law_behind_your_node', 'visual_servoing', 'behind_ros2_control'])
def test_a_node_that_is_asked_to_end_shows_no_traceback(name: str, tmp_path: Path) -> None:
    with (
        started(tmp_path),
        subprocess.Popen(
            [sys.executable, str(EXAMPLES / f'{name}.py')], stderr=subprocess.PIPE, text=True
        ) as process,
    ):
        from graph_helpers import await_that

        await_that(lambda: has_handler_of_sigterm(process.pid), 'a handler')
        process.terminate()
        assert 'Traceback' not in process.communicate(timeout=60.0)[1]


def has_handler_of_sigterm(pid: int) -> bool:
    """Whether a process has asked the kernel for the signal."""
    caught = re.search(r'SigCgt:\s*(\w+)', Path(f'/proc/{pid}/status').read_text())
    return bool(int(caught[1], 16) >> (signal.SIGTERM - 1) & 1)


def test_the_notebook_runs_and_prints_what_it_says_that_it_prints() -> None:
    sys.path.insert(0, str(EXAMPLES.parent / 'docs'))
    from extension.notebook import printed, run

    path = EXAMPLES / 'from_velocity_to_torque.ipynb'
    on_page = printed(json.loads(path.read_text(encoding='utf-8')))
    for now, then in zip(printed(run(path)), on_page, strict=True):
        assert not differences(now, then)


@pytest.mark.parametrize(('options', 'right_keeps_its_place'), [((), True), (('--far',), False)])
def test_of_two_arms_the_second_gives_way_only_where_both_tasks_cannot_be(
    options: tuple[str, ...], right_keeps_its_place: bool
) -> None:
    joints, left, right = run('two_arms', *options).splitlines()
    assert joints.count(',') == 6
    assert numbers(left)[0] < 1.0  # [mm]
    assert (numbers(right)[0] < 0.1) == right_keeps_its_place


@pytest.mark.realtime
def test_a_camera_steers_the_arm_round_a_circle(tmp_path: Path) -> None:
    with started(tmp_path, sim={'patience': 60.0}, controller={}):
        behind, change = run('visual_servoing', '--seconds', '6').splitlines()
    _, lag, _ = numbers(behind)
    assert 10.0 < lag < 25.0  # 50 mm/s over 3 1/s is 17 mm; machines stall for some pictures
    assert numbers(change)[0] < 3.0


def test_the_example_of_a_preference_defines_it_and_does_nothing_else() -> None:
    assert not run('own_preference')  # test_plugins uses it


def test_every_example_has_a_test() -> None:
    tested = re.findall(r"run\('(\w+)'", Path(__file__).read_text(encoding='utf-8'))
    assert sorted(tested) == sorted(path.stem for path in EXAMPLES.glob('*.py'))


@pytest.mark.realtime
def test_behind_ros2_control_the_controller_responds_and_moves_the_arm(tmp_path: Path) -> None:
    parameters = {'rate': 100.0, 'robot': 'lwr4_paper'}
    controller = parameters | {'robot_interface': 'ros2_control'}
    planner = parameters | {'autostart': True}
    with started(tmp_path, controller=controller, planner=planner):
        responses, moved = run('behind_ros2_control', '--seconds', '4').splitlines()
    share, states = numbers(responses)
    assert share > 50.0  # 99.4 beside ten other processes; in bad moments a machine stalls for long
    assert states == 400
    assert numbers(moved)[0] > 0.1
    log = (tmp_path / 'controller.log').read_text()
    assert log.count('ignoring gripper_left_joint, gripper_right_joint') == 1
