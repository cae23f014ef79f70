"""What the demo says before and after suits what happened."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')

from redres_ros import RobotModel
from redres_ros.cli.demo import after, before
from redres_ros.demo.demo import DemoOptions

PAPERS = DemoOptions('rectangle', 'minimum_acceleration', 500.0, parameters={'limits': ('none',)})


def outcome(**given: Any) -> Any:
    motion = {'path_deviation': (0.0004, 3.0), 'acceleration': (8.7, 7.3)}
    usual = {'motion': motion, 'interrupted': False, 'stop_reason': '', 'ending': 'finished'}
    return SimpleNamespace(**{'forces': np.zeros((0, 4)), **usual, **given})


def test_before_it_names_the_arm_the_law_and_what_is_at_stake(model: RobotModel) -> None:
    said = before(DemoOptions('rectangle', 'minimum_velocity', 500.0), model)
    assert '7 joints' in said
    assert 'minimum_velocity' in said
    assert 'stretched' in said


@pytest.mark.parametrize(
    ('given', 'words'),
    [
        ({}, ('finished the task', '0.4 mm', '8.7 rad/s²', 'minimum_velocity')),
        ({'forces': np.array([(2.0, 0.0, 0.0, -21.5)])}, ('finished the task', '21.5 N')),
        ({'stop_reason': 'acceleration of A1', 'ending': 'NOT finished'}, ('stopped', 'limits')),
        ({'stop_reason': 'timing: 6 missed', 'ending': 'NOT finished'}, ('too busy', '--lockstep')),
    ],
)
def test_after_it_says_what_came_of_it_and_what_to_try_next(
    given: dict[str, Any], words: tuple[str, ...]
) -> None:
    said = after(outcome(**given), PAPERS, 'lwr4_paper')
    assert all(word in said for word in words)


@pytest.mark.parametrize(
    'given', [{'interrupted': True}, {'motion': None}, {'ending': 'NOT finished'}]
)
def test_where_there_is_nothing_to_learn_it_says_nothing(given: dict[str, Any]) -> None:
    assert after(outcome(**given), PAPERS, 'lwr4_paper') == ''


@pytest.mark.parametrize(
    ('options', 'robot'),
    [
        (DemoOptions('', 'minimum_acceleration', 500.0), 'xarm7.urdf'),
        (DemoOptions('rectangle', 'minimum_velocity', 500.0), 'lwr4_paper'),
    ],
)
def test_what_holds_for_the_papers_task_alone_is_said_of_no_other_run(
    options: DemoOptions, robot: str
) -> None:
    said = after(outcome(), options, robot)
    assert 'finished the task' in said and 'is stopped' not in said
