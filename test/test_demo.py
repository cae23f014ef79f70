"""`redres demo`: whole runs of the three nodes as processes."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import yaml

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from redres_ros.controller import Controller
from redres_ros.laws import make_law
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.closed_loop import run
from redres_ros.simulation.recording import columns
from redres_ros.waypoints import load_task

pytestmark = pytest.mark.slow

JOINTS = slice(1, 8)  # columns q1..q7


def command(out: Path) -> list[str]:
    """The command line of a demo."""
    return [sys.executable, '-m', 'redres_ros.cli', 'demo', '--out', str(out)]


def demo(out: Path, *arguments: str, timeout: float = 180.0) -> subprocess.CompletedProcess[str]:
    """A run to its end."""
    return subprocess.run(
        [*command(out), *arguments], text=True, timeout=timeout, capture_output=True, check=False
    )


def motion(out: Path) -> np.ndarray:
    """The rows of motion.csv."""
    return np.loadtxt(out / 'motion.csv', delimiter=',', skiprows=1)


def at_common_times(one: np.ndarray, two: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The rows that both have. A listener loses a sample now and then when the machine stalls; the
    nodes do not.
    """
    ticks = [np.round(rows[:, 0] / 0.002).astype(int) for rows in (one, two)]
    common = np.intersect1d(*ticks)
    assert len(common) > 0.5 * max(map(len, ticks))
    return one[np.isin(ticks[0], common)], two[np.isin(ticks[1], common)]


@pytest.fixture(scope='module')
def lockstep(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run in lock-step with an ideal arm."""
    out = tmp_path_factory.mktemp('lockstep')
    done = demo(out, '--lockstep', '--plant', 'ideal')
    assert done.returncode == 0, done.stdout + done.stderr
    return out


def test_lockstep_equals_the_loop_that_uses_the_reference_one_tick_late(lockstep: Path) -> None:
    controller = Controller(
        RobotModel.named('lwr4_paper'), make_law('minimum_acceleration'), 0.002, switch_time=0.2
    )
    expected = run(controller, load_task('rectangle'), delay=1).data
    got, expected = at_common_times(motion(lockstep), expected)
    np.testing.assert_allclose(got[:, JOINTS], expected[:, JOINTS], rtol=0.0, atol=1e-9)


@pytest.fixture
def short_task(tmp_path: Path) -> str:
    """A file with a corner from the start of the paper's task: 0.2 m to the side and 0.2 m up, each
    in 1 s.
    """
    task = load_task('rectangle')
    path = tmp_path / 'short.yaml'
    waypoints = task.waypoints[0] + np.array([[0.0, 0.0, 0.0], [0.0, -0.2, 0.0], [0.0, -0.2, 0.2]])
    path.write_text(
        yaml.safe_dump(
            {
                'robot': task.robot,
                'start': np.degrees(task.start).tolist(),
                'segment_time': 1.0,
                'waypoints': waypoints.tolist(),
            }
        )
    )
    return str(path)


def test_lockstep_with_physics_is_the_same_to_the_last_bit_every_time(
    tmp_path: Path, short_task: str
) -> None:
    for name in ('first', 'second'):
        done = demo(tmp_path / name, '--lockstep', '--task', short_task)
        assert done.returncode == 0, done.stdout + done.stderr
    first, second = at_common_times(motion(tmp_path / 'first'), motion(tmp_path / 'second'))
    # Norms of accelerations reach back to the row before, which one of the recordings may lack.
    np.testing.assert_array_equal(
        first[:, : columns(7).index('task_error')], second[:, : columns(7).index('task_error')]
    )


def test_composed_in_one_process_the_nodes_do_the_same(tmp_path: Path, lockstep: Path) -> None:
    done = demo(tmp_path, '--lockstep', '--plant', 'ideal', '--composed')
    assert done.returncode == 0, done.stdout + done.stderr
    assert (tmp_path / 'composed.log').exists() and not (tmp_path / 'controller.log').exists()
    composed, apart = at_common_times(motion(tmp_path), motion(lockstep))
    np.testing.assert_array_equal(composed[:, JOINTS], apart[:, JOINTS])


@pytest.mark.realtime
def test_the_law_of_least_acceleration_finishes_in_real_time(tmp_path: Path) -> None:
    done = demo(tmp_path, '--law', 'minimum_acceleration')
    assert done.returncode == 0, done.stdout + done.stderr
    rows = motion(tmp_path)
    error = np.linalg.norm(
        rows[-1, [columns(7).index(name) for name in 'xyz']] - load_task('rectangle').waypoints[-1]
    )
    assert error < 0.001
    assert (tmp_path / 'motion.png').stat().st_size > 10_000
    for word in ('finished', 'not stopped', 'CMD', 'answered in time', 'error at the end'):
        assert word in done.stdout


@pytest.mark.realtime
def test_the_law_of_least_velocity_is_stopped_after_7_s(tmp_path: Path) -> None:
    done = demo(tmp_path, '--law', 'minimum_velocity')
    assert done.returncode == 1, done.stdout + done.stderr
    assert 'protective stop' in done.stdout
    assert 7.0 < motion(tmp_path)[-1, 0] < 8.5


@pytest.mark.realtime
def test_a_task_is_repeated_for_as_long_as_asked_and_memory_stays(tmp_path: Path) -> None:
    duration = 600 if os.environ.get('REDRES_NIGHTLY') == '1' else 12
    done = demo(tmp_path, '--duration', str(duration), timeout=duration + 120)
    assert done.returncode == 0, done.stdout + done.stderr
    said = {line[:28].strip(): line[28:].split() for line in done.stdout.splitlines()}
    rounds = int(said['rounds'][0])
    seconds = float(said['rounds'][2])
    assert seconds >= duration
    assert (
        rounds >= duration / 7.0
    )  # three seconds there, three back, and half of one for everything between
    for name in ('sim', 'controller', 'planner'):
        start, end = (float(said[f'memory of {name}'][place]) for place in (0, 6))
        assert 10.0 < start < 500.0
        assert end - start < 5.0
    answered = int(said['cycles'][3])
    (sent, heard) = (int(said['states'][place]) for place in (0, 2))
    cycles = int(said['cycles'][0].rstrip(','))
    late, missed = (int(said['of the others'][place]) for place in (0, 2))
    assert answered + late + missed <= cycles  # the rest was waited for
    assert 0.9 * sent < heard <= sent


@pytest.mark.realtime
def test_a_law_switched_on_the_way_is_blended(tmp_path: Path, short_task: str) -> None:
    switches = ('--switch', 'minimum_velocity@0.5', '--switch', 'minimum_acceleration@1.2')
    done = demo(tmp_path, '--lockstep', '--plant', 'ideal', '--task', short_task, *switches)
    assert done.returncode == 0, done.stdout + done.stderr
    acceleration = motion(tmp_path)[:, columns(7).index('joint_acceleration_norm')]
    alone = []
    for law in ('minimum_velocity', 'minimum_acceleration'):
        controller = Controller(
            RobotModel.named('lwr4_paper'), make_law(law), 0.002, switch_time=0.2
        )
        alone.append(
            run(controller, load_task(short_task), delay=1).peak('joint_acceleration_norm')[0]
        )
    assert acceleration.max() < 1.5 * max(alone)


@pytest.mark.realtime
def test_ctrl_c_ends_the_demo_and_leaves_no_process(tmp_path: Path) -> None:
    handle = signal.signal(
        signal.SIGINT, signal.default_int_handler
    )  # who runs the tests in the background ignores it
    process = subprocess.Popen(
        command(tmp_path),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    signal.signal(signal.SIGINT, handle)
    until = time.monotonic() + 30.0
    while len(descendants(process.pid)) < 3 and time.monotonic() < until:
        time.sleep(0.1)
    time.sleep(3.0)
    children = descendants(process.pid)
    assert len(children) >= 3
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=30.0)
    assert process.returncode == 130
    assert 'Traceback' not in errors
    assert not [pid for pid in children if is_running(pid)]


@pytest.mark.realtime
def test_killing_the_demo_takes_its_nodes_along(tmp_path: Path) -> None:
    process = subprocess.Popen(
        command(tmp_path), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    until = time.monotonic() + 30.0
    while len(descendants(process.pid)) < 3 and time.monotonic() < until:
        time.sleep(0.1)
    children = descendants(process.pid)
    assert len(children) >= 3
    process.kill()
    process.wait()
    until = time.monotonic() + 10.0
    while any(map(is_running, children)) and time.monotonic() < until:
        time.sleep(0.05)
    assert not [pid for pid in children if is_running(pid)]


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (('--law', 'foo'), ('foo', 'minimum_velocity')),
        (('--damping', '501'), ('501', '0 to 500')),
        (('--rate', '0'), ('rate', '0', '10')),
        (('--rate', 'nan'), ('rate', 'nan')),
        (('--rate', '300'), ('300', 'plant steps')),
        (('--task', 'foo'), ('foo', 'rectangle')),
        (('--switch', 'minimum_velocity'), ('minimum_velocity', 'LAW@SECONDS')),
        (('--switch', 'foo@1'), ('foo', 'minimum_velocity')),
        (('--domain', '500'), ('500', '0 to 232')),
        (('--out', '/dev/null/here'), ('/dev/null/here',)),
    ],
)
def test_bad_options_get_one_line(
    tmp_path: Path, arguments: tuple[str, ...], words: tuple[str, ...]
) -> None:
    done = demo(tmp_path, *arguments) if '--out' not in arguments else demo(Path(arguments[1]))
    assert done.returncode == 1
    lines = [line for line in done.stderr.splitlines() if line.strip()]
    assert len(lines) == 1, done.stderr
    assert all(word in lines[0] for word in words), lines[0]


def test_without_rclpy_the_demo_names_the_missing_package(tmp_path: Path) -> None:
    program = (
        "import sys; sys.modules['rclpy'] = None\nfrom redres_ros.cli import main\n"
        f"sys.exit(main(['demo', '--out', {str(tmp_path)!r}]))"
    )
    done = subprocess.run(
        [sys.executable, '-c', program], text=True, capture_output=True, timeout=60, check=False
    )
    assert done.returncode == 1
    assert len(done.stderr.strip().splitlines()) == 1
    assert 'rclpy' in done.stderr
    assert 'pip install' in done.stderr


def descendants(pid: int) -> list[int]:
    """Processes whose parent is the given one."""
    return [
        int(entry.name)
        for entry in Path('/proc').iterdir()
        if entry.name.isdecimal() and _parent(entry) == pid
    ]


def is_running(pid: int) -> bool:
    """Whether a process exists and is more than an entry that nobody has waited for."""
    try:
        return (Path('/proc') / str(pid) / 'stat').read_text().rpartition(')')[2].split()[0] != 'Z'
    except OSError:
        return False


def _parent(entry: Path) -> int:
    try:
        return int((entry / 'stat').read_text().rpartition(')')[2].split()[1])
    except OSError:
        return 0
