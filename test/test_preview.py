"""The path to come on its way from planner to controller: the real nodes, in virtual time."""

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from virtual_graph import VirtualRun, virtual_run

from redres_ros import Preview
from redres_ros.errors import RedresError
from redres_ros.nodes.conversions import from_path, to_path

RATE = 200.0  # [Hz]
TOPIC = 'planner/preview', 'controller'


def accelerations(run: VirtualRun) -> np.ndarray:
    return np.linalg.norm(np.diff(run.references, 2, axis=0), axis=1) * RATE**2


def motion(fault=None, *, horizon: float = 2.0, seconds: float = 9.0) -> VirtualRun:
    """The rectangle past the stretched arm, without limits, with a fault of the previews."""
    controller = {'limits': 'none', 'horizon': horizon}
    with virtual_run(RATE, controller=controller, planner={'autostart': True}) as run:
        if fault:
            run.graph.faults[TOPIC] = fault
        run.run(seconds)
        assert run.nodes['controller']._loop.safety_filter.count == 0
        assert run.nodes['sim']._session.reason == ''
    return run


@pytest.mark.slow
def test_with_a_preview_the_arm_accelerates_less_than_half_as_much():
    assert accelerations(motion()).max() < 0.5 * accelerations(motion(horizon=0.0)).max()


def jumping(message, now):
    for pose in message.poses:
        pose.pose.position.x += 0.2 * round(now * 5.0 % 2.0)
    return [(0.0, message)]


@pytest.mark.slow
@pytest.mark.parametrize(
    'fault',
    [
        jumping,  # by 0.2 m
        lambda message, now: [(1.0, message)],  # a second late
        lambda message, now: [(0.0, message)] * (now % 2.0 < 1.0),  # ends
    ],
)
def test_whatever_becomes_of_previews_the_safety_filter_need_not_act(fault):
    run = motion(fault, seconds=5.0)
    assert accelerations(run).max() < 24.0  # nothing steps by 0.12 rad/s


def test_a_preview_that_takes_cycles_to_read_is_refused():
    with virtual_run(RATE) as run:
        run.graph.publish(TOPIC[0], Path(poses=[PoseStamped()] * 400))
        run.run(0.5)
        refused = [line for node, line in run.graph.log if node == 'controller']
    assert 'bytes; allowed: 20000' in ' '.join(refused)


def test_a_path_comes_back_from_its_message():
    R = np.tile(np.eye(3), (3, 1, 1))
    preview = Preview((-0.1, 0.5, 1.0), np.arange(9.0).reshape(3, 3), R)
    message = to_path(10**9, 'world', preview)
    for turns in (False, True):
        received = from_path(message, ('world', ''), turns)
        assert np.allclose(received.times, preview.times)
        assert (received.positions == preview.positions).all()
        assert np.allclose(received.rotations, preview.rotations[: 3 * turns])


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        (lambda path: setattr(path.poses[2].header, 'frame_id', 'nose'), "in 'nose'; allowed"),
        (lambda path: path.poses.reverse(), 'times of a path do not increase'),
        (lambda path: setattr(path.poses[1].pose.position, 'y', np.nan), 'hold NaN'),
        (lambda path: setattr(path, 'poses', []), '0 poses; allowed: 1 to 1000'),
        (lambda path: setattr(path, 'poses', path.poses * 334), '1002 poses'),
    ],
)
def test_a_bad_path_is_refused_with_what_is_wrong(change, words):
    message = to_path(10**9, 'world', Preview((-0.1, 0.5, 1.0), np.zeros((3, 3))))
    change(message)
    with pytest.raises(RedresError, match=words):
        from_path(message, ('world', ''), turns=False)
