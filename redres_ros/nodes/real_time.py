"""Real-time settings of the kernel: scheduling priority, locked memory, processor affinity."""

import ctypes
import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from rclpy.node import Node

from redres_ros.errors import reason_of
from redres_ros.nodes.parameters import declare
from redres_ros.parameter import param

ANY = (-1,)  # of processors; ROS has no empty arrays
# Linux: no processor enters a sleep state while a process holds this file open with a 0 in it.
LATENCY = Path('/dev/cpu_dma_latency')

_MCL_CURRENT = 1
_MCL_FUTURE = 2  # Linux, see mlockall(2)


@dataclass(frozen=True)
class RealTime:
    """Parameters of every node, for its process; by default nothing is asked of the kernel."""

    realtime_priority: int = param(
        0, 'SCHED_FIFO priority of all threads; 0: ordinary scheduling', 0, 99
    )
    lock_memory: bool = param(False, 'lock all memory, so that none is paged out')
    processors: tuple[int, ...] = param(ANY, 'processors to run on, such as [2, 3]; [-1]: any')
    keep_awake: bool = param(
        False,
        'keep the processors from entering sleep states, which costs power; needs permission '
        f'to write {LATENCY}',
    )


def ask_kernel(node: Node) -> None:
    """Apply the node's real-time parameters; what is not permitted gets one warning."""
    wanted = declare(node, RealTime())
    priority = wanted.realtime_priority
    processors = wanted.processors
    if priority:
        ask = partial(_set_priority, priority)
        _try(node, f'realtime_priority {priority}', 'ordinary scheduling', 'ulimit -r', ask)
    if wanted.lock_memory:
        _try(node, 'lock_memory', 'memory that can be paged out', 'ulimit -l', _lock_memory)
    if processors != ANY:
        see = f'there are 0 to {(os.cpu_count() or 1) - 1}'
        _try(
            node, f'processors {list(processors)}', 'any', see, partial(_set_processors, processors)
        )
    if wanted.keep_awake:
        see = f'sudo chmod o+w {LATENCY}, or a udev rule'
        _try(node, 'keep_awake', 'processors that sleep', see, _keep_awake)


def _try(node: Node, wanted: str, otherwise: str, see: str, ask: Callable[[], None]) -> None:
    try:
        ask()
    except (OSError, ValueError) as error:  # ValueError: a processor below 0
        reason = reason_of(error)
        node.get_logger().warning(f'{wanted}: {reason} ({see}); going on with {otherwise}')
    else:
        node.get_logger().info(f'{wanted}: granted')


def _threads() -> Iterable[int]:
    """All threads of this process: those of DDS receive the messages."""
    return [int(path.name) for path in Path('/proc/self/task').iterdir()]


def _set_priority(priority: int) -> None:
    for thread in _threads():
        os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(priority))


def _keep_awake() -> None:
    os.write(os.open(LATENCY, os.O_WRONLY), bytes(4))  # the file stays open


def _lock_memory() -> None:
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mlockall(_MCL_CURRENT | _MCL_FUTURE):
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))


def _set_processors(processors: Iterable[int]) -> None:
    for thread in _threads():
        os.sched_setaffinity(thread, processors)
