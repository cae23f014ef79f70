"""How the arm moves when messages are late or missing: the real nodes, in virtual time."""

from array import array
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from nightly import by_day

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from builtin_interfaces.msg import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from virtual_graph import Fault, VirtualRun, no_fault, virtual_run
from wire_faults import changed, late, off

from redres_ros.nodes.conversions import to_pose, to_twist

pytestmark = pytest.mark.slow

RATE = 500.0  # [Hz]
SECONDS = 4.5
DX = np.array([0.02, -0.05, 0.03])  # [m/s]


def held_up(*, every: float, length: float) -> Fault:
    """Now and then nothing comes for a time [s], and then all of it at once."""

    def fault(message: Any, now: float) -> list[tuple[float, Any]]:
        return [(max(length - now % every, 0.0), message)]

    return fault


def peak(fault: Fault = no_fault) -> float:
    """The largest norm of the robot's acceleration over the first side of the rectangle and a half
    [rad/s^2], with a fault of the planner's velocities.
    """
    of_nodes = {'controller': {'limits': 'none'}, 'planner': {'autostart': True}}
    with virtual_run(RATE, **of_nodes) as run:
        run.graph.faults['cartesian_velocity', 'controller'] = fault
        run.run(SECONDS)
        assert run.commanding
        assert run.nodes['sim']._session.reason == ''
    references = run.references
    assert np.abs(references[-1] - references[-2]).max() * RATE > 0.01  # it moves
    accelerations = np.diff(references, 2, axis=0) * RATE**2
    return float(np.linalg.norm(accelerations, axis=1).max())


@pytest.mark.parametrize(
    'fault',
    by_day(
        1,
        [
            pytest.param(late(most=6 / RATE, share=1.0), id='all up to 6 cycles'),
            pytest.param(late(most=12 / RATE, share=0.2), id='a fifth up to 12'),
            pytest.param(held_up(every=0.5, length=0.04), id='20 cycles'),
            pytest.param(held_up(every=0.9, length=0.08), id='40 cycles'),
        ],
    ),
)
def test_late_task_velocities_hardly_show_without_patience(fault: Fault) -> None:
    assert peak(fault) < 1.3 * peak()


def test_silence_of_the_states_is_reported_once_and_its_end_too() -> None:
    with virtual_run() as run:
        wire = ('joint_states', 'controller')

        def log_lines() -> list[str]:
            words = ('no joint_states', 'states of the robot accepted again')
            return [line for _, line in run.graph.log if line.startswith(words)]

        reported = ['no joint_states for 0.1 s', 'states of the robot accepted again']
        # The robot starts later; a state or two do not end a silence.
        for silent, fed, lines in ((2.0, 1.0, 0), (1.0, 0.015, 1), (2.0, 2.0, 2)):  # [s], [s]
            run.graph.faults[wire] = off()
            run.run(silent)
            del run.graph.faults[wire]
            run.run(fed)
            assert log_lines() == reported[:lines]


@pytest.fixture
def resting() -> Iterator[VirtualRun]:
    """A robot in command mode whose planner waits to be started."""
    with virtual_run() as run:
        run.run(0.5)
        assert run.commanding
        yield run


def spoiled(name: str, value: Any) -> Callable[[JointState], None]:
    return lambda message: setattr(message, name, value)


@pytest.mark.parametrize(
    ('spoil', 'words'),
    [
        (spoiled('name', ['a'] * 7), ()),  # of another device
        (spoiled('position', [0.0] * 6), ('6 values of position', '7 joints')),
        (lambda message: message.position.__setitem__(2, np.nan), ('nan', 'finite')),
        (lambda message: message.name.__setitem__(0, 'a'), ('missing lwr_a1_joint', 'arm a')),
        (lambda message: setattr(message.header, 'stamp', Time()), ('no stamp',)),
    ],
)
def test_a_bad_state_gets_no_response_and_is_reported_once(
    resting: VirtualRun, spoil: Callable[[JointState], None], words: tuple[str, ...]
) -> None:
    resting.graph.kept['joint_command'] = []
    resting.graph.faults['joint_states', 'controller'] = changed(spoil)
    resting.run(0.05)
    assert resting.graph.kept['joint_command'] == []
    resting.graph.faults.clear()
    resting.run(2.0)
    assert resting.graph.kept['joint_command']
    log = [line for node, line in resting.graph.log if node == 'controller']
    refusals = [line for line in log if 'joint_states refused' in line]
    assert len(refusals) == (1 if words else 0)
    assert all(word in refusals[0] for word in words), refusals
    assert any('joint_states accepted again' in line for line in log) is bool(words)


@pytest.mark.parametrize(
    ('dx', 'frame', 'words'),
    [
        (DX, 'nose', ('nose', 'tool0', 'world')),
        (1e9 * DX, 'world', ('m/s', 'max_linear')),
        (np.array([0.1, np.nan, 0.0]), 'world', ('nan', 'finite')),
    ],
)
def test_a_bad_task_velocity_does_not_move_the_arm_and_is_reported_once(
    resting: VirtualRun, dx: np.ndarray, frame: str, words: tuple[str, ...]
) -> None:
    q = resting.nodes['sim']._robot.reference
    for _ in range(5):
        resting.graph.publish('cartesian_velocity', to_twist(0, frame, dx))
        resting.run(0.02)
    assert (resting.nodes['sim']._robot.reference == q).all()
    [refusal] = [line for _, line in resting.graph.log if 'cartesian_velocity' in line]
    assert all(word in refusal for word in words), refusal


def test_without_a_clock_to_take_the_time_from_a_node_watches_on() -> None:
    with virtual_run(controller={'use_sim_time': True}) as run:
        run.graph.kept['/diagnostics'] = []
        run.graph.faults['joint_states', 'controller'] = off()
        run.run(8.0)
        assert run.health('controller').message == 'no joint_states'


def test_a_second_robot_in_motion_is_reported_and_stops_the_arm(resting: VirtualRun) -> None:
    assert resting.graph.call('planner/start').success
    resting.run(1.0)
    resting.nodes['controller'].count_publishers = lambda topic: 2
    resting.graph.kept['controller/mode'] = []
    resting.graph.publish('sim/session_state', String(data='MON'), latched=True)
    resting.run(3.0)
    modes = [message.data for _, message in resting.graph.kept['controller/mode']]
    assert modes[:3] == ['stopping', 'holding', 'mirroring']
    assert any('two nodes publish sim/session_state' in line for _, line in resting.graph.log)


HOSTILE = 'x\n[ERROR] [1.0] [robot]: all is well\x1b[2J\u2028' + 'y' * 100_000


def test_no_text_of_others_gets_beyond_one_readable_line_of_a_log(resting: VirtualRun) -> None:
    graph = resting.graph
    assert graph.call('planner/start').success
    resting.run(0.5)
    before = len(graph.log)
    ours = resting.nodes['controller']._joints.names
    foreign = JointState(name=[HOSTILE], position=array('d', [0.0]))
    mixed = JointState(name=[*ours[:-1], HOSTILE], position=array('d', [0.0] * len(ours)))
    for topic, message in (
        ('joint_states', foreign),
        ('joint_states', mixed),
        ('cartesian_velocity', to_twist(0, HOSTILE, np.zeros(3))),
        ('target_pose', to_pose(0, HOSTILE, np.zeros(3), np.eye(3))),
        ('joint_command', mixed),
        ('sim/session_state', String(data=HOSTILE)),
        ('sim/stop_reason', String(data=HOSTILE)),
    ):
        graph.publish(topic, message)
        resting.run(0.1)
    lines = [line for _, line in graph.log[before:]]
    assert len(lines) >= 6
    assert all(line.isprintable() for line in lines)
    assert max(map(len, lines)) < 1200


def test_a_second_start_does_not_make_the_planner_begin_anew_on_the_way(
    resting: VirtualRun,
) -> None:
    resting.graph.kept['cartesian_velocity'] = []

    def speed() -> float:
        _, twist = resting.graph.kept['cartesian_velocity'][-1]
        linear = twist.twist.linear
        return float(np.linalg.norm((linear.x, linear.y, linear.z)))

    assert 'takes 9 s' in resting.graph.call('planner/start').message
    resting.run(1.0)
    under_way = speed()
    assert under_way > 0.1
    assert 'running already' in resting.graph.call('planner/start').message
    resting.run(0.01)
    assert speed() == pytest.approx(under_way, rel=0.1)
