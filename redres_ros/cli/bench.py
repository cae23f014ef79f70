"""`redres bench`: how fast it is on this machine, beside other libraries."""

import argparse
import math
import os
import platform
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from redres_ros.cli.files import made
from redres_ros.cli.options import add_out
from redres_ros.cli.parser import OptionError, add_command, option
from redres_ros.errors import RangeError, UnknownNameError

_ROUNDS = 100.0  # of the ticks, per second of --duration
_OPERATED = 40.0  # [s] of simulated teleoperation, per second of --duration
_USUAL = 'tick,loop'  # the operators take an hour
_PACKAGES = (  # whose versions are written down
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


def add(commands: Any) -> None:
    """Declare the subcommand."""
    bench = add_command(
        commands,
        'bench',
        'speed on this machine, beside other libraries',
        '# tick and loop, about six minutes',
        '--only tick  # without ROS',
        '--only teleoperation  # simulated operators, about an hour; without ROS',
        '--only loop --rates 500',
    )
    duration = (
        'duration of each loop at each rate [s]; ticks are measured in proportion, and '
        f'each operator steers {_OPERATED:g} times as long'
    )
    option(bench, '--only', 'A,B,...', f'parts to measure: {", ".join(_PARTS)}', _USUAL)
    option(bench, '--duration', 'S', duration, 3.0, within=(0.01, 3600.0, 's'))
    option(bench, '--seeds', 'N', 'runs of each operator', 1, within=(1, 100, ''))
    option(bench, '--rates', 'HZ,...', 'rates of the loop [Hz]', '250,500,1000')
    add_out(bench, 'redres_bench', 'bench.json and logs')
    bench.set_defaults(run=_bench)


def _bench(options: argparse.Namespace) -> int:
    from redres_ros.simulation.report import print_tables, progress_bar

    parts = _names(options.only)
    options.rates = _numbers(options.rates)
    if 'loop' in parts:
        import redres_ros.bench.loop  # noqa: F401, that there is no ROS is to be known at once
    made(options.out, 'bench.json')
    results = {}
    for name in parts:
        with progress_bar(name) as progress:
            results[name] = _PARTS[name](options, progress)
    write_results(results, options.out / 'bench.json')
    print_tables(*(result.table() for result in results.values()))
    print(f'all figures {options.out}/bench.json')
    return 0


def _tick(options: argparse.Namespace, progress: Callable[[float], None]) -> Any:
    from redres_ros.bench.tick import measure_tick

    _name_missing()
    return measure_tick(max(math.ceil(_ROUNDS * options.duration), 1), progress)


def _name_missing() -> None:
    """Print which peers are not installed."""
    from redres_ros.bench.peers import missing_peers
    from redres_ros.files.remedy import remedy

    if missing := missing_peers():
        command = remedy('bench', *missing)
        print(f'not installed, and left out: {", ".join(missing)}; {command}')


def _loop(options: argparse.Namespace, progress: Callable[[float], None]) -> Any:
    from redres_ros.bench.loop import measure_loop

    return measure_loop(options.rates, options.duration, options.out, progress)


def _teleoperation(options: argparse.Namespace, progress: Callable[[float], None]) -> Any:
    from redres_ros.bench.teleoperation import measure_teleoperation

    _name_missing()
    return measure_teleoperation(_OPERATED * options.duration, options.seeds, progress)


_PARTS = {'tick': _tick, 'loop': _loop, 'teleoperation': _teleoperation}


def _names(text: str) -> list[str]:
    names = text.split(',')
    for name in names:
        if name not in _PARTS:
            raise UnknownNameError('part of the bench', name, _PARTS)
    return names


def _numbers(text: str) -> list[float]:
    from redres_ros.loop.cycle_counter import RATES

    try:
        rates = [float(rate) for rate in text.split(',')]
    except ValueError:
        raise OptionError(f'--rates {text}; expected numbers, such as 250,500,1000') from None
    for rate in rates:
        if not RATES[0] <= rate <= RATES[1]:
            raise RangeError('--rates', rate, *RATES, 'Hz')
    return rates


def write_results(results: Mapping[str, Any], path: Path) -> None:
    """Write figures with units in their names, and the machine.

    Args:
        results: Results by part of the bench.
        path: Path of the file.

    Raises:
        FileError: It cannot be written.
    """
    from redres_ros.files.text import write_json

    figures = {name: result.figures() for name, result in results.items()}
    write_json({'machine': _machine(), **figures}, path)


def _machine() -> dict[str, object]:
    """Processor, cores, kernel, Python and packages."""
    from redres_ros.files.installed import version_of

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
