"""On what machine, and with what versions, something was measured."""

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

_PACKAGES = (
    'redres_ros',
    'numpy',
    'scipy',
    'pin',
    'mujoco',
    'ros-jazzy-rclpy',
    'pin-pink',
    'mink',
    'qpsolvers',
    'quadprog',
    'daqp',
    'proxsuite',
)


def describe() -> dict[str, object]:
    """Processor, cores, kernel, Python and packages."""
    versions = {name: found for name in _PACKAGES if (found := _version(name))}
    return {
        'processor': _processor(),
        'cores': len(os.sched_getaffinity(0)),
        'kernel': platform.release(),
        'python': platform.python_version(),
        'versions': versions,
    }


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ''


def _processor() -> str:
    try:
        lines = Path('/proc/cpuinfo').read_text().splitlines()
    except OSError:
        lines = []
    models = (line.partition(':')[2].strip() for line in lines if line.startswith('model name'))
    return next(models, platform.processor() or 'unknown')
