"""Processor time of processes, from /proc."""

import time
from collections.abc import Mapping
from pathlib import Path

# [s] of /proc/<pid>/stat: Linux counts in hundredths for user space, whatever the kernel's HZ
_TICK = 0.01


class ProcessorMeter:
    """Fraction of a core that processes take, from the moment when it is made.

    Args:
        processes: Their numbers by name.
    """

    def __init__(self, processes: Mapping[str, int]) -> None:
        self._processes = dict(processes)
        self._begun = time.perf_counter()
        self._before = self._seconds()

    def shares(self) -> dict[str, float]:
        """Mean since then, by name."""
        elapsed = time.perf_counter() - self._begun
        after = self._seconds()
        return {name: (after[name] - self._before[name]) / elapsed for name in after}

    def _seconds(self) -> dict[str, float]:
        return {name: processor_seconds(pid) for name, pid in self._processes.items()}


def processor_seconds(pid: int) -> float:
    """Processor time of a process so far, all its threads, in user space and the kernel [s]; NaN if
    it is gone.
    """
    try:
        fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    except OSError:
        return float('nan')
    return (int(fields[11]) + int(fields[12])) * _TICK  # utime and stime, see proc(5)
