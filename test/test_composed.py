"""Several nodes in one process and one executor."""

import threading
import time
from pathlib import Path

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

import rclpy
from graph_helpers import PATIENCE, Observer, await_that, graph
from own_ros import ros

from redres_ros.nodes.runtime import Spinner

pytestmark = pytest.mark.slow


def test_planner_and_controller_in_one_process_move_a_robot_in_another(tmp_path: Path) -> None:
    with graph(Observer) as (observer, start):
        start('sim', tmp_path / 'sim.log', patience=5.0)
        composed = start('composed --no-sim', tmp_path / 'composed.log', autostart=True)
        await_that(lambda: observer.speed > 0.02, 'motion', every=0.02)
        await_that(lambda: observer.commands, 'commands at the observer')
        composed.check()
        observer.assert_all_was_well()


def test_a_wait_in_the_thread_of_the_executor_ends_when_a_callback_sets_the_event() -> None:
    with ros():
        node = rclpy.create_node('node')
        event = threading.Event()
        spinner = Spinner([node], threading.Event())
        assert not spinner.wait(0.05, event)
        node.create_timer(0.05, event.set)
        begun = time.monotonic()
        assert spinner.wait(PATIENCE, event)
        assert time.monotonic() - begun < PATIENCE / 2.0
        spinner.close()
