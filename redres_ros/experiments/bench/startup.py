"""How long it takes to start: each node until it is made, and `redres --help`, beside Python itself."""

import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from redres_ros.experiments.bench.goals import Goal
from redres_ros.experiments.bench.timing import Times

HELP, PYTHON = 'redres --help', 'python -c pass'
HELP_GOAL = 0.3  # [s]

_CALLS = {PYTHON: ('-c', 'pass'), HELP: ('-m', 'redres_ros.cli', '--help')}


@dataclass(frozen=True)
class StartupResult:
    """Times by what was started."""

    times: Mapping[str, Times]

    def goals(self) -> list[Goal]:
        """The help's."""
        return [Goal(f'{HELP}: seconds', self.times[HELP].median, HELP_GOAL)]

    def table(self) -> str:
        """One line each."""
        lines = [f"{'from nothing until it is there':<36}{'median [s]':>12}{'max [s]':>10}"]
        return '\n'.join([*lines, *(f'{name:<36}{times.median:12.2f}{times.quantile(1.0):10.2f}'
                                    for name, times in self.times.items())])

    def figures(self) -> dict[str, object]:
        """For the file of results."""
        return {name: {'median_s': times.median, 'max_s': times.quantile(1.0)} for name, times in self.times.items()}


def measure_startup(programs: Mapping[str, str], repetitions: int,
                    progress: Callable[[float], None] | None = None) -> StartupResult:
    """Commands in turn: Python, the help, and these programs, by name, each of which makes a node and ends."""
    calls = {**_CALLS, **{name: ('-c', program) for name, program in programs.items()}}
    samples: dict[str, list[float]] = {name: [] for name in calls}
    for turn in range(repetitions):
        for name, arguments in calls.items():
            samples[name].append(_seconds(arguments))
        if progress:
            progress((turn + 1) / repetitions)
    return StartupResult({name: Times(np.array(times)) for name, times in samples.items()})


def _seconds(arguments: tuple[str, ...]) -> float:
    begun = time.perf_counter()
    subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - begun
