"""Fixtures that several test files share, and what spares time."""

import gc
import importlib.util
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')  # numpy's threads would compete with processes

import compile_all
import numpy as np
import pytest
from hypothesis import settings

from redres_ros import RobotModel, RobotState, WaypointTask, load_task

settings.register_profile('untimed', deadline=None)  # machines may be busy
settings.load_profile('untimed')

_OPTIONAL = ('matplotlib', 'mujoco', 'rclpy', 'viser')
_MISSING = re.compile(
    r"No module named '(\w+)|(?:needs|package) (\w+),?(?: which)? is not installed"
)


def pytest_configure(config: pytest.Config) -> None:
    """Have formulas compiled before tests that wait for a node, and by one process alone.

    A shell's background jobs are born deaf to Ctrl-C, and so would be what the tests start there.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if config.option.junitprefix and not config.option.markexpr:
        config.option.markexpr = 'not slow'  # colcon test, which many a workspace runs as a whole
    if not hasattr(config, 'workerinput'):
        compile_all.compile_all()
        # What processes import that start elsewhere may be another copy, that of an installation.
        subprocess.call([sys.executable, compile_all.__file__])


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Whether only tests against the clock are asked for, and a file has none to be loaded for."""
    if not config.option.markexpr.startswith('realtime') or collection_path.suffix != '.py':
        return None
    return 'mark.realtime' not in collection_path.read_text(encoding='utf-8') or None


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[Any]:
    """What is loaded stays: looking for garbage in it takes a fifteenth of the tests' time."""
    gc.disable()
    collected = yield
    gc.freeze()
    gc.enable()
    return collected


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report() -> Iterator[Any]:
    return _skipped_without_package((yield))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Iterator[Any]:
    return _skipped_without_package((yield))


def _skipped_without_package(report: Any) -> Any:
    """Skip what an optional package is missing for: a distribution has no MuJoCo."""
    missing = _MISSING.search(str(report.longrepr)) if report.failed else None
    name = missing and (missing[1] or missing[2])
    if name in _OPTIONAL and importlib.util.find_spec(name) is None:
        report.outcome = 'skipped'
        report.longrepr = (report.nodeid, 0, f"needs {name}: pip install '.[test]'")
    return report


def pytest_make_parametrize_id(val: object) -> str | None:
    """Words, numbers and settings as they are; pytest by itself would count them."""
    if isinstance(val, dict):
        shown = [f'{name}={value}' for name, value in val.items()]
    elif isinstance(val, tuple) and all(isinstance(part, (str, int, float)) for part in val):
        shown = [str(part) for part in val]
    else:
        return None
    return ' '.join(shown)[:40] or 'nothing'  # characters, of each part of an id


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What runs against the clock or at night is slow, too."""
    for item in items:
        if item.get_closest_marker('realtime') or item.get_closest_marker('nightly'):
            item.add_marker('slow')


@pytest.fixture(scope='session')
def model() -> RobotModel:
    """The paper's arm with the dynamics of Section 5.2."""
    return RobotModel.named('lwr4_paper', dynamics='cylinders')


@pytest.fixture(scope='session')
def task() -> WaypointTask:
    return load_task('rectangle')


@pytest.fixture(scope='session')
def states(model: RobotModel) -> list[RobotState]:
    """A hundred random states of the paper's arm."""
    random = np.random.default_rng(0)
    q = random.uniform(-2.0, 2.0, (100, 7))
    dq = random.normal(0.0, 1.0, (100, 7))
    return [model.state(*pair) for pair in zip(q, dq, strict=True)]
