"""How a node of this package runs and ends: domain, executor, signals, errors in one line."""

import gc
import os
import random
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TypeVar

import numpy as np
import rclpy
from rclpy.exceptions import ParameterException
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rclpy.utilities import get_rmw_implementation_identifier

from redres_ros.errors import RedresError, reason_of
from redres_ros.files.processes import end_with_parent, open_error_output
from redres_ros.nodes.parameters import warn_of_misspelt
from redres_ros.types import Seconds

N = TypeVar('N', bound=Node)
_RCLError = rclpy_implementation.RCLError

# environment variable: number of the process without which a node is not to live on
PARENT = 'REDRES_PARENT'

_WAIT = 0.1  # [s] Python's signal handlers do not run while the executor waits in C++
_HIGHEST_DOMAIN = 232  # the last one whose ports exist
_FREE_DOMAINS = range(1, 102)  # above them the ports run into those that Linux hands out to anyone

_RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
_PROFILE = 'FASTRTPS_DEFAULT_PROFILES_FILE'
# A user who sets one of these has decided which nodes find each other.
_DISCOVERY = (
    _RANGE,
    _PROFILE,
    'ROS_STATIC_PEERS',
    'ROS_LOCALHOST_ONLY',
    'ROS_DISCOVERY_SERVER',
    'FASTDDS_DEFAULT_PROFILES_FILE',
)


class Spinner:
    """An EventsExecutor for some nodes, spun until an event is set.

    EventsExecutor.spin() and spin_once() without a timeout never return in the PyPI build of rclpy
    7.1.6 (their endless wait overflows there and becomes a busy loop). spin_until_future_complete
    loses 32 bytes at each call, so what is called in every cycle is spin_once.
    """

    def __init__(self, nodes: Sequence[Node], stopped: threading.Event) -> None:
        self._executor = EventsExecutor()
        self._never = Future()
        self._stopped = stopped
        self._nodes = nodes
        for node in nodes:
            self._executor.add_node(node)

    def spin(self) -> None:
        """Run callbacks until the event is set; sets it itself when a callback fails."""
        try:
            while rclpy.ok() and not self._stopped.is_set():
                self._executor.spin_until_future_complete(self._never, timeout_sec=_WAIT)
        finally:
            self._stopped.set()

    @contextmanager
    def in_thread(self) -> Iterator[None]:
        """Spin in a second thread, until the event is set or the block is left."""
        thread = threading.Thread(target=self.spin, name='executor')
        thread.start()
        try:
            yield
        finally:
            self._stopped.set()
            thread.join()

    def wait(self, seconds: Seconds, event: threading.Event | None = None) -> bool:
        """Run callbacks for that long, or until one sets the event; whether it is set. Without one
        it is that of the end. For a loop in the thread of the executor.
        """
        until = time.monotonic() + seconds
        event = event or self._stopped
        while not event.is_set():
            left = max(until - time.monotonic(), 0.0)
            self._executor.spin_once(timeout_sec=left)  # returns after a callback
            if left == 0.0:
                break
        return event.is_set()

    def close(self) -> None:
        """Release the executor and its nodes; spin() must have returned."""
        self._executor.shutdown()
        for node in self._nodes:
            node.destroy_node()


@contextmanager
def own_domain(domain: int | None = None) -> Iterator[int]:
    """Set a ROS domain on this host alone; None: one that no other graph here uses. Yields its
    number; raises RedresError if there is none.
    """
    if domain is None:
        domain = _find_free_domain()
    _check_domain(str(domain))
    before = dict(os.environ)
    os.environ['ROS_DOMAIN_ID'] = str(domain)
    for name in _DISCOVERY:
        os.environ.pop(name, None)
    _stay_on_this_host()
    try:
        yield domain
    finally:
        os.environ.clear()
        os.environ.update(before)


def _stay_on_this_host() -> None:
    """Let nobody on the network command the arm, unless the user has decided that.

    LOCALHOST of ROS would bring back the shared memory of Fast DDS: a profile says the same.
    """
    if any(map(os.environ.get, _DISCOVERY)):
        return
    is_fast_dds = 'fastrtps' in get_rmw_implementation_identifier()
    os.environ[_RANGE] = 'SUBNET' if is_fast_dds else 'LOCALHOST'
    os.environ[_PROFILE] = str(Path(__file__).with_name('loopback.xml'))


def _find_free_domain() -> int:
    """A domain on whose discovery port (RTPS: 7400 + 250 domain) no participant listens."""
    for domain in random.SystemRandom().sample(_FREE_DOMAINS, len(_FREE_DOMAINS)):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe, suppress(OSError):
            probe.bind(('', 7400 + 250 * domain))
            return domain
    raise RedresError(f'every ROS domain from 1 to {_FREE_DOMAINS[-1]} is in use on this machine')


def _check_domain(domain: str) -> None:
    if not (domain.isdecimal() and int(domain) <= _HIGHEST_DOMAIN):
        raise RedresError(
            f'ROS domain is {domain} (--domain or ROS_DOMAIN_ID); allowed: 0 to {_HIGHEST_DOMAIN}'
        )


def start(arguments: list[str] | None = None, domain: int | None = None) -> None:
    """rclpy.init with our own signal handling; without a domain in that of the environment. Raises
    RedresError.
    """
    # Opening Fast DDS's shared memory for a process that has just come can hold up all who publish
    # for a third of a second (issue 6535 of Fast DDS).
    os.environ.setdefault('FASTDDS_BUILTIN_TRANSPORTS', 'UDPv4')
    _stay_on_this_host()
    _check_domain(os.environ.get('ROS_DOMAIN_ID') or '0' if domain is None else str(domain))
    try:
        rclpy.init(args=arguments, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
    except Exception as error:  # noqa: BLE001, what rclpy raises here has no base class of its own
        reason = reason_of(error)
        if 'logging' in reason:
            reason += '; set ROS_LOG_DIR to a directory that can be written to'
        raise RedresError(f'ROS 2 does not start ({type(error).__name__}): {reason}') from None


def _made(make: Callable[[], N]) -> N:
    """A node. Raises RedresError if DDS lacks a resource, such as open files."""
    try:
        return make()
    except RuntimeError as error:
        if isinstance(error, _RCLError):
            raise
        raise RedresError(f'ROS 2 makes no node: {reason_of(error)}') from None


@contextmanager
def spun(make: Callable[[], N], domain: int | None = None) -> Iterator[N]:
    """Start ROS and yield a node that is spun in a thread. Raises RedresError."""
    start(domain=domain)
    with ExitStack() as stack:
        stack.callback(rclpy.try_shutdown)
        node = _made(make)
        spinner = Spinner([node], threading.Event())
        stack.callback(spinner.close)
        stack.enter_context(spinner.in_thread())
        yield node


def run_nodes(
    *makes: Callable[[], Node], arguments: list[str] | None = None, domain: int | None = None
) -> int:
    """Make nodes, spin them, and end them cleanly on SIGINT or SIGTERM; returns the exit status: 0,
    1 after an error, or 130 after a signal before the nodes began.

    One of them may have `run(stopped, spinner)`, a loop of its own that ends when the event is set;
    callbacks run when it waits by the spinner. By default the command line is that of the process.
    """
    open_error_output()
    stopped = threading.Event()
    # Results are looked at; numpy's warning would be a second line.
    np.seterr(over='ignore', invalid='ignore')
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopped.set())
    _watch_parent(stopped)
    try:
        start(arguments, domain)
        nodes = [_made(make) for make in makes]
        warn_of_misspelt(nodes)
        _spin(nodes, stopped)
    except KeyboardInterrupt:
        return 130  # while a node waited for what it is made from
    except (RedresError, _RCLError, ParameterException) as error:
        if isinstance(error, _RCLError) and not rclpy.ok():
            return 0  # the context went down under a call: the end, not an error
        print(f'{Path(sys.argv[0]).stem}: {reason_of(error)}', file=sys.stderr, flush=True)
        return 1
    finally:
        rclpy.try_shutdown()
    return 0


def _watch_parent(stopped: threading.Event) -> None:
    """End when the process named in the environment dies."""
    parent = os.environ.get(PARENT)
    if parent:
        end_with_parent(signal.SIGTERM)
        if os.getppid() != int(parent):
            stopped.set()  # it had died before


def _spin(nodes: list[Node], stopped: threading.Event) -> None:
    spinner = Spinner(nodes, stopped)
    gc.collect()
    gc.freeze()  # nor is the collector to look through the nodes in the middle of a cycle
    try:
        loop = next((node.run for node in nodes if hasattr(node, 'run')), None)
        if loop:
            loop(stopped, spinner)
        else:
            spinner.spin()
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # under ros2 launch Ctrl-C arrives twice
        spinner.close()
