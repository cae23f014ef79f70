"""Fixtures that several test files share, and what spares time."""

import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

# Several processes share the processors. numpy's threads would compete with them.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

import numpy as np
import pytest

from redres_ros import RobotModel, RobotState, WaypointTask, load_task


def pytest_configure(config: pytest.Config) -> None:
    """Have the limits compiled before tests that wait for a node, and by one process alone."""
    if not hasattr(config, 'workerinput'):
        import redres_ros.limits  # noqa: F401


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Whether all tests of a file are left out anyway: then what they import need not be loaded."""
    if not collection_path.name.startswith('test_') or collection_path.suffix != '.py':
        return None
    marks = re.findall(r'mark\.(\w+)', collection_path.read_text(encoding='utf-8'))
    if config.option.markexpr == 'realtime' and 'realtime' not in marks:
        return True
    text = collection_path.read_text(encoding='utf-8')
    if config.option.markexpr == 'not slow' and '\npytestmark = pytest.mark.slow\n' in text:
        return True
    return None


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[Any]:
    """Lines are counted in quick tests only. Counting them takes as long again."""
    counters = []
    if item.get_closest_marker('slow') and 'coverage' in sys.modules:
        # In a process of pytest-xdist there are two, and as one stops the other goes on.
        from coverage import Coverage

        while counter := Coverage.current():
            counter.stop()
            counters.append(counter)
    try:
        return (yield)
    finally:
        for counter in reversed(counters):
            counter.start()


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
