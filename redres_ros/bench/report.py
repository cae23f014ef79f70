"""Writes the results of a run to a file, with the machine and the versions."""

import json
import math
import os
import platform
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from redres_ros.files.installed import version_of
from redres_ros.files.text import writing

_PACKAGES = (
    'redres_ros',
    'numpy',
    'scipy',
    'pin',
    'mujoco',
    'ros-jazzy-rclpy',
    'embodik',
    'roboplan-oink',
    'pin-pink',
    'mink',
    'qpsolvers',
    'quadprog',
    'daqp',
    'proxsuite',
)


def write_json(results: Mapping[str, Mapping[str, object]], path: Path) -> None:
    """Write figures with units in their names, and the machine; null for what is no number.

    Args:
        results: Figures by the part of the bench that measured them.
        path: Of the file.

    Raises:
        FileError: It cannot be written.
    """
    content = _finite({'machine': machine(), **results})
    with writing(path):
        path.write_text(json.dumps(content, indent=2) + '\n', encoding='utf-8')


def machine() -> dict[str, object]:
    """Processor, cores, kernel, Python and packages."""
    versions = {name: version_of(name) for name in _PACKAGES}
    return {
        'processor': _processor(),
        'cores': len(os.sched_getaffinity(0)),
        'kernel': platform.release(),
        'python': platform.python_version(),
        'versions': {name: found for name, found in versions.items() if found},
    }


def _processor() -> str:
    try:
        lines = Path('/proc/cpuinfo').read_text().splitlines()
    except OSError:
        lines = []
    models = [line.partition(':')[2].strip() for line in lines if line.startswith('model name')]
    return models[0] if models else platform.processor() or 'unknown'


def _finite(value: Any) -> Any:
    """The same with None for NaN and infinity, which JSON does not know."""
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
