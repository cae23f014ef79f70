"""A separate ROS graph: an unused domain on this machine, and node processes that end with this
one.
"""

import fcntl
import json
import math
import os
import random
import signal
import socket
import subprocess
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import IO, Any

from redres_ros.errors import RedresError
from redres_ros.files.modules import module_command, module_environment
from redres_ros.nodes.discovery import joined_domain
from redres_ros.nodes.runtime import PARENT

ALL = 'all'  # topics of a recording

_DOMAINS = range(1, 102)  # above them the ports run into those that Linux hands out to anyone
_PATIENCE = 5.0  # [s] between asking a process to end and killing it


class GraphError(RedresError):
    """No free domain, or a node that ended on its own."""


@contextmanager
def own_domain(wanted: int | None = None) -> Iterator[int]:
    """Set the environment to a ROS domain.

    Args:
        wanted: the domain; None for one that no other graph on this host uses.

    Yields:
        Its number.

    Raises:
        GraphError: every domain is taken.
        RangeError: there is no such domain.
    """
    with ExitStack() as stack:
        if wanted is None:
            lock, domain = _free_domain()
            stack.enter_context(lock)
        else:
            domain = wanted
        stack.enter_context(joined_domain(domain))
        yield domain


def _free_domain() -> tuple[IO[bytes], int]:
    for domain in random.SystemRandom().sample(_DOMAINS, len(_DOMAINS)):
        lock = _claim(domain)
        if lock and not _in_use(domain):
            return lock, domain
    raise GraphError(
        f'every ROS domain from {_DOMAINS[0]} to {_DOMAINS[-1]} is in use on this machine'
    )


def _claim(domain: int) -> IO[bytes] | None:
    """A lock against runs of ours that have no participant yet; None where another has it."""
    try:
        path = Path(tempfile.gettempdir()) / f'redres_ros_domain_{domain}.lock'
        lock = path.open('wb')
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return None
    return lock


def _in_use(domain: int) -> bool:
    """Whether a participant listens on the domain's discovery port (RTPS: 7400 + 250 domain)."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(('', 7400 + 250 * domain))
        except OSError:
            return True
    return False


class NodeProcess:
    """One of our nodes as a process of its own, which cannot outlive this one.

    It does not get the terminal's Ctrl-C: the process that started it ends it.

    Args:
        name: of the executable in nodes/, or of a module of the package, as 'bench.echo'; its own
            options may follow, as in 'composed --no-sim'.
        log: file for what it prints.
        parameters: of the node.
        recording: MCAP file for its messages, see `redres_ros.demo.recorded`; None for none.
        topics: those that are recorded; ALL among them: all.
    """

    def __init__(
        self,
        name: str,
        log: Path,
        parameters: Mapping[str, Any],
        *,
        recording: Path | None = None,
        topics: Sequence[str] = (),
    ) -> None:
        self.name = name
        self._log = log
        node, *own = name.split()
        module = f'redres_ros.{node}' if '.' in node else f'redres_ros.nodes.{node}'
        if recording:
            module = 'redres_ros.demo.recorded'
            own = [name, str(recording), ','.join(topics)]
        arguments = []
        for key, value in parameters.items():
            arguments += ['-p', f'{key}:={_yaml(value)}']
        with log.open('wb') as output:
            self._process = subprocess.Popen(
                [*module_command(module), *own, '--ros-args', *arguments],
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                env={**module_environment(), PARENT: str(os.getpid())},
            )

    @property
    def pid(self) -> int:
        """Process number."""
        return self._process.pid

    @property
    def memory(self) -> float:
        """Memory in use, [MB], that is resident; NaN once it has ended."""
        try:
            return (
                int(Path(f'/proc/{self.pid}/statm').read_text().split()[1])
                * os.sysconf('SC_PAGE_SIZE')
                / 1e6
            )
        except (OSError, IndexError):
            return math.nan

    @property
    def status(self) -> int | None:
        """Its exit status; None while it runs."""
        return self._process.poll()

    def check(self) -> None:
        """Raise GraphError if the process has ended, with the last line that it printed."""
        if self.status is not None:
            said = self.last_line() or 'it printed nothing'
            raise GraphError(f'node {self.name} ended with status {self.status}: {said}')

    def last_line(self) -> str:
        """The last line printed so far."""
        lines = self._log.read_text(errors='replace').strip().splitlines()
        return lines[-1] if lines else ''

    def wait(self, timeout: float) -> int:
        """Its exit status, once it has ended. Raises subprocess.TimeoutExpired."""
        return self._process.wait(timeout)

    def ask_to_end(self) -> None:
        """Ask it to end, as Ctrl-C would."""
        if self.status is None:
            self._process.send_signal(signal.SIGINT)

    def end(self) -> None:
        """Ask it to end, wait, and kill it if it does not."""
        self.ask_to_end()
        try:
            self.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def _yaml(value: Any) -> str:
    """A parameter's value as the command line of a node takes it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (list, tuple)):
        return f'[{", ".join(map(_yaml, value))}]'
    if isinstance(value, float):
        return repr(float(value))
    # In quotes: a path may hold what YAML reads otherwise, and a text may be empty.
    return json.dumps(value) if isinstance(value, str) else str(value)
