"""What the tutorials claim of sources of their own, with the real nodes in virtual time."""

import re
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pytest
from nightly import by_day

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from geometry_msgs.msg import PoseStamped
from virtual_graph import VirtualRun, virtual_run

from redres_ros.nodes.conversions import to_twist
from redres_ros.robot_model import RobotModel

PAGES = Path(__file__).parents[1] / 'docs' / 'tutorials'
RATE = 500.0  # [Hz]
ACTION = {'x': 0.5, 'y': 0.2, 'z': 0.6, 'qx': 0.0, 'qy': 0.0, 'qz': 0.0, 'qw': 1.0}


def errors_behind_a_camera(gain: float) -> np.ndarray:
    """How far the tip is behind a target on a circle, at each picture after some time [mm]."""
    with virtual_run(RATE) as run:
        assert run.run_until(lambda: run.commanding, 5.0)
        tip = np.zeros(3)

        def look(message: PoseStamped) -> None:
            place = message.pose.position
            tip[:] = (place.x, place.y, place.z)

        run.graph.listen('controller/tip_pose', 'camera', look)
        run.run(0.1)
        centre = tip - (0.0, 0.04, 0.0)
        seen = np.zeros(3)
        errors = []
        for k in range(90):
            angle = 2.0 * np.pi * k / 150.0  # a round in 5 s
            target = centre + 0.04 * np.array((0.0, np.cos(angle), np.sin(angle)))
            dx = gain * seen  # of the picture before
            seen = target - tip
            errors.append(1e3 * float(np.linalg.norm(seen)))
            run.graph.publish('cartesian_velocity', to_twist(0, '', dx))
            run.run(1.0 / 30.0)
    return np.array(errors[60:])


@pytest.mark.slow
@pytest.mark.parametrize('gain', by_day(1, [10, 25]))
def test_the_tip_is_as_far_behind_a_camera_as_the_page_says(gain: int) -> None:
    page = (PAGES / 'visual_servoing.md').read_text(encoding='utf-8')
    [row] = re.findall(rf'\| {gain} \| ([^|]*) \|', page)
    reported = float(re.findall(r'[\d.]+', row)[0])
    errors = errors_behind_a_camera(float(gain))
    if 'steadily' in row:
        assert errors == pytest.approx(reported, abs=0.3)  # the page's arm has physics
    else:
        assert errors.max() > 3.0 * errors.min()


@pytest.mark.slow
@pytest.mark.parametrize(
    ('page', 'use'),
    [
        ('target_pose.md', ''),
        ('../howto/steer.md', f'arm = Arm()\narm.connect()\narm.send_action({ACTION})'),
    ],
)
def test_a_target_pose_is_reached_as_the_page_says(page: str, use: str) -> None:
    [code] = re.findall(r'```python\n(.*?)```', (PAGES / page).read_text(), re.DOTALL)
    model = RobotModel.named('lwr4')
    with virtual_run(RATE, 'lwr4') as run:
        assert run.run_until(lambda: run.commanding, 5.0)
        words: list[str] = []
        run.graph.listen('planner/state', 'test', lambda message: words.append(message.data))
        with mock.patch.dict('sys.modules', rclpy=_rclpy_on_wires(run)):
            exec(compile(f'{code}\n{use}', page, 'exec'), {})
        assert run.run_until(lambda: words[-1] == 'finished', 20.0)
        q = run.nodes['sim']._robot.plant.q
    assert model.tip(q)[0] == pytest.approx((0.5, 0.2, 0.6), abs=2e-3)


def _rclpy_on_wires(run: VirtualRun) -> Any:
    """As much of rclpy as the page uses."""
    publisher = mock.Mock()
    publisher.get_subscription_count.return_value = 1
    node = mock.Mock()

    def create_publisher(kind: type, topic: str, depth: int) -> Any:
        publisher.publish = lambda message: run.graph.publish(topic, message)
        return publisher

    node.create_publisher = create_publisher
    return mock.Mock(create_node=lambda name: node)
