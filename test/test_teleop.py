"""`redres teleop`: what keys ask for, and that the terminal is afterwards as it was before."""

import fcntl
import os
import pty
import signal
import subprocess
import sys
import termios
from pathlib import Path

import numpy as np
import pytest
from nightly import by_day

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from geometry_msgs.msg import TwistStamped
from graph_helpers import PATIENCE, Probe, await_that, graph
from rclpy.node import Node
from std_srvs.srv import Trigger

from redres_ros.cli import main
from redres_ros.errors import RangeError
from redres_ros.graph.teleop import HELP, WAYS, KeyMap, TwistPublisher

FORWARD = np.array((0.05, 0.0, 0.0, 0.0, 0.0, 0.0))  # [m/s], [rad/s]


def test_the_page_shows_the_keys_as_the_command_does() -> None:
    page = Path(__file__).parents[1] / 'docs' / 'tutorials' / 'teleoperation.md'
    assert f'```text\n{HELP}\n```' in page.read_text(encoding='utf-8')


def test_every_row_of_the_task_velocity_has_a_key_for_either_way() -> None:
    assert sorted(WAYS.values()) == [(row, sign) for row in range(6) for sign in (-1.0, 1.0)]


@pytest.mark.parametrize(('key', 'way'), WAYS.items())
def test_a_key_moves_or_turns_along_its_axis_alone(key: str, way: tuple[int, float]) -> None:
    key_map = KeyMap(speed=0.1, turn=0.4)
    key_map.press(key, 10.0)
    expected = np.zeros(6)
    expected[way[0]] = way[1] * (0.1 if way[0] < 3 else 0.4)
    np.testing.assert_array_equal(key_map.twist(10.1), expected)


def test_a_key_that_is_not_repeated_counts_as_released_within_a_second() -> None:
    key_map = KeyMap()
    key_map.press('w', 0.0)
    key_map.press('w', 0.5)
    assert key_map.twist(1.0).any()
    assert not key_map.twist(1.5).any()


@pytest.mark.parametrize('key', [' ', 'x', '\x1b', '\N{SNOWMAN}'])
def test_space_and_every_key_without_a_meaning_stop(key: str) -> None:
    key_map = KeyMap()
    key_map.press('w', 0.0)
    key_map.press(key, 0.1)
    assert not key_map.twist(0.1).any()


def test_speeds_stay_within_what_a_keyboard_should_have() -> None:
    key_map = KeyMap(speed=0.1)
    for _ in range(100):
        key_map.press('+', 0.0)
    assert (key_map.speed, key_map.turn) == (2.0, 6.0)
    with pytest.raises(RangeError, match=r'speed is nan; allowed: 0\.001 to 2 \(m/s\)'):
        KeyMap(speed=np.nan)


def test_without_a_terminal_it_refuses_in_one_line(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with Path(os.devnull).open() as nothing:
        monkeypatch.setattr(sys, 'stdin', nothing)
        assert main(['teleop']) == 1
    said = capsys.readouterr()
    assert said.err == ('redres teleop: standard input is not a terminal; keys cannot be read\n')


class Session:
    """`redres teleop` in a terminal of its own."""

    def __init__(self, *options: str) -> None:
        self._hand, self.terminal = pty.openpty()
        self.before = termios.tcgetattr(self.terminal)
        self._process = subprocess.Popen(
            [sys.executable, '-m', 'redres_ros.cli', 'teleop', *options],
            stdin=self.terminal,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
        )

    def type(self, keys: bytes) -> None:
        os.write(self._hand, keys)

    @property
    def has_changed_the_terminal(self) -> bool:
        return termios.tcgetattr(self.terminal) != self.before

    def signal(self, number: signal.Signals) -> None:
        self._process.send_signal(number)

    def end(self) -> tuple[int, str]:
        """Exit status, and what it complained of."""
        _, complaint = self._process.communicate(timeout=PATIENCE)
        return self._process.returncode, complaint


@pytest.mark.slow
def test_a_planner_is_stopped_once_in_each_motion() -> None:
    stops = []

    def stop(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        stops.append(request)
        return response

    with graph(lambda: Node('operator')) as (node, _):
        node.create_service(Trigger, 'planner/stop', stop)
        twists = TwistPublisher(node)
        now = 10.0

        def moves() -> bool:
            nonlocal now
            now += 0.02
            twists.publish(FORWARD, now)
            return bool(stops)

        await_that(moves, 'the stop')
        twists.publish(FORWARD, now + 0.02)
        twists.publish(0.0 * FORWARD, now + 1.0)
        twists.publish(FORWARD, now + 2.0)
        await_that(lambda: len(stops) == 2, 'that of the next motion')


@pytest.mark.parametrize('ending', by_day(1, ['Ctrl-C', 'SIGTERM', 'SIGHUP']))
def test_keys_are_published_and_the_terminal_is_given_back(ending: str) -> None:
    with graph(Probe) as (probe, _):
        received = probe.listen(TwistStamped, 'left/cartesian_velocity')
        session = Session('--speed', '0.2', '--frame', 'tool0', '--namespace', 'left')
        await_that(lambda: session.has_changed_the_terminal, 'the terminal to be read')
        await_that(lambda: probe.count_publishers('left/cartesian_velocity') > 0, 'the publisher')

        def moves() -> bool:
            session.type(b'd')
            return sum(message.twist.linear.y != 0.0 for message in received) >= 5

        await_that(moves, 'task velocities of the key', every=0.1)
        if ending == 'Ctrl-C':
            session.type(b'\x03')
        else:
            session.signal(signal.Signals[ending])
        status, complaint = session.end()
    assert (status, complaint) == (0, '')
    assert not session.has_changed_the_terminal
    assert {message.twist.linear.y for message in received} <= {-0.2, 0.0}
    assert {message.header.frame_id for message in received} == {'tool0'}
    assert {message.header.stamp.sec for message in received} == {0}  # now
