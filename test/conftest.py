"""Fixtures that several test files share."""

import numpy as np
import pytest

from redres_ros import RobotModel, RobotState, WaypointTask, load_task


def pytest_configure(config: pytest.Config) -> None:
    """Have the limits compiled before tests that wait for a node, and by one process alone."""
    if not hasattr(config, 'workerinput'):
        import redres_ros.limits  # noqa: F401


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What runs against the clock is slow, too."""
    for item in items:
        if item.get_closest_marker('realtime'):
            item.add_marker('slow')


@pytest.fixture(scope='session')
def model() -> RobotModel:
    """The paper's arm with the dynamics of Section 5.2."""
    return RobotModel.named('lwr4_paper', dynamics='cylinders')


@pytest.fixture(scope='session')
def task() -> WaypointTask:
    """The paper's task."""
    return load_task('rectangle')


@pytest.fixture(scope='session')
def states(model: RobotModel) -> list[RobotState]:
    """A hundred random states of the paper's arm."""
    random = np.random.default_rng(0)
    return [
        model.state(q, dq)
        for q, dq in zip(
            random.uniform(-2.0, 2.0, (100, 7)), random.normal(0.0, 1.0, (100, 7)), strict=True
        )
    ]
