"""Processors that do not sleep, so that whoever is woken up on one begins at once."""

import errno
import os
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

from redres_ros.nodes import busy_loop

# Linux: while somebody holds it open with a 0 in it, no processor sleeps
LATENCY = Path('/dev/cpu_dma_latency')

_GROUPS = Path('/sys/fs/cgroup')
_QUOTA = 'cpu.max'  # of a control group, see the kernel's cgroup-v2
_UNLIMITED = 'max'

_loops: list[subprocess.Popen[bytes]] = []


def keep_awake() -> str:
    """Keep the processors awake until this process ends.

    Where the kernel does not permit that as such, loops of the lowest priority do it.

    Returns:
        How.

    Raises:
        OSError: Neither is possible.
    """
    try:
        latency = os.open(LATENCY, os.O_WRONLY)
    except OSError:
        _start_loops()
        return f'by a loop of the lowest priority on each, as {LATENCY} is not to be written'
    os.write(latency, bytes(4))  # the file stays open
    return f'by {LATENCY}'


def may_keep_awake() -> bool:
    """Whether `keep_awake` would succeed."""
    return os.access(LATENCY, os.W_OK) or not _has_quota(_groups())


def _start_loops() -> None:
    """One for each processor that this process may run on."""
    if _has_quota(_groups()):
        raise OSError(errno.EPERM, 'loops would use up the quota of processor time')
    for processor in os.sched_getaffinity(0):
        command = [sys.executable, '-I', '-S', busy_loop.__file__, str(processor), str(os.getpid())]
        # A session of its own gets no Ctrl-C, and a share of the processor that is not ours.
        _loops.append(subprocess.Popen(command, start_new_session=True))


def _groups() -> list[Path]:
    """The control groups of this process, from the outermost one that can be seen."""
    lines = Path('/proc/self/cgroup').read_text().splitlines()
    groups = []
    for line in lines:
        _, controllers, path = line.split(':', 2)
        if not controllers:  # version 2, which has one tree for all
            own = _GROUPS / path.lstrip('/')
            groups = [own, *own.parents]
    return [group for group in groups if group.is_relative_to(_GROUPS)]


def _has_quota(groups: Iterable[Path]) -> bool:
    """Whether one of these groups is allowed a part of the processors' time only."""
    files = [group / _QUOTA for group in groups]
    return any(file.exists() and file.read_text().split()[:1] != [_UNLIMITED] for file in files)
