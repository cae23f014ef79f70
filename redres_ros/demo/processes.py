"""The processes of a demo, which end with this one."""

import json
import math
import os
import signal
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from redres_ros.errors import RedresError
from redres_ros.files.processes import handled, module_command, module_environment
from redres_ros.nodes.runtime import PARENT
from redres_ros.planning.waypoints import WaypointTask

_PATIENCE = 5.0  # [s] between asking a process to end and killing it
_PAGE = 'view.page'  # module that serves the page
_ADDRESS = 'page: '  # how the line begins in which it reports its address
# [s] that an ordinary machine may stall; the fake arm's clock then stands still
_CLOCK_PATIENCE = 5.0


class GraphError(RedresError):
    """A node that ended on its own."""


@dataclass(frozen=True)
class DemoOptions:
    """The options of a run.

    Attributes:
        task: Its name.
        law: Name of the law at the start.
        rate: Cycles a second [Hz].
        dynamics: Dynamics of the controller's model.
        switches: (law, seconds after the task began).
        lockstep: As fast as possible, instead of in real time.
        composed: One process instead of three.
        duration: How long the task is repeated [s]; 0 for once.
        page: Parameters of the page, with which the nodes stay until Ctrl-C; None for no page.
        parameters: More of them, for every node that has them.
    """

    task: str
    law: str
    rate: float
    dynamics: str = 'identified'
    switches: tuple[tuple[str, float], ...] = ()
    lockstep: bool = False
    composed: bool = False
    duration: float = 0.0
    page: Mapping[str, Any] | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict)


class NodeProcess:
    """One of our nodes as a process of its own, which cannot outlive this one.

    It does not get the terminal's Ctrl-C: the process that started it ends it.

    Args:
        name: The executable in nodes/, or a module of the package, such as 'view.page'; its own
            options may follow, as in 'composed --no-sim'.
        log: File for what it prints.
        parameters: Parameters of the node.
    """

    def __init__(self, name: str, log: Path, parameters: Mapping[str, Any]) -> None:
        self.name = name
        self._log = log
        node, *own = name.split()
        module = f'redres_ros.{node}' if '.' in node else f'redres_ros.nodes.{node}'
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
        self.pid = self._process.pid

    def memory(self) -> float:
        """Memory in use, [MB], that is resident; NaN once it has ended."""
        try:
            pages = int(Path(f'/proc/{self.pid}/statm').read_text().split()[1])
            return pages * os.sysconf('SC_PAGE_SIZE') / 1e6
        except (OSError, IndexError):
            return math.nan

    @property
    def status(self) -> int | None:
        """Its exit status; None while it runs."""
        return self._process.poll()

    def check(self) -> None:
        """Raise GraphError if the process has ended, with the last line that it printed."""
        if self.status is not None:
            printed = self.last_line() or 'it printed nothing'
            raise GraphError(f'node {self.name} ended with status {self.status}: {printed}')

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


class NodeGroup:
    """The nodes of one run, and the page that shows them.

    Args:
        options: The options of a run.
        task: The one that the options name.
        damping: Of the law at the start.
        out: Directory for what they print.
    """

    def __init__(self, options: DemoOptions, task: WaypointTask, damping: float, out: Path) -> None:
        self.nodes: list[NodeProcess] = []
        self._page: NodeProcess | None = None
        self._options = options
        self._task = task
        self._damping = damping
        self._out = out

    @contextmanager
    def running(self) -> Iterator[None]:
        """Processes while the block runs.

        They end in the order in which they were started, the sim first: to be left alone by the
        controller would be a fault of its connection.
        """
        try:
            for name, own in self._processes().items():
                self.nodes.append(NodeProcess(name, self._out / f'{name}.log', own))
            if self._options.page is not None:
                self._page = NodeProcess(_PAGE, self._out / f'{_PAGE}.log', self._options.page)
            yield
        finally:
            # A second signal must not leave a process behind.
            with handled(signal.SIG_IGN, signal.SIGINT, signal.SIGTERM):
                if self._page:
                    self._page.ask_to_end()
                for process in (*self.nodes, self._page):
                    if process:
                        process.end()

    def check(self) -> None:
        """Raise GraphError if a node has ended, or the page has failed."""
        for node in self.nodes:
            node.check()
        if self._page and self._page.status:
            self._page.check()

    def page_is_served(self) -> bool:
        """Whether the page is served."""
        return self._page is not None and self._page.status is None

    def page_address(self) -> str:
        """Where the page is served; empty before it is."""
        return self._page.last_line().partition(_ADDRESS)[2] if self._page else ''

    def _processes(self) -> dict[str, dict[str, Any]]:
        """Parameters of each process, by its name."""
        parameters = self._parameters()
        if not self._options.composed:
            return parameters
        together: dict[str, Any] = {}
        for own in parameters.values():
            together |= own
        return {'composed': together}

    def _parameters(self) -> dict[str, dict[str, Any]]:
        """Parameters of each node, by its name."""
        options = self._options
        shared = {
            'lockstep': options.lockstep,
            'rate': options.rate,
            'robot': self._task.robot,
            'dynamics': options.dynamics,
            **options.parameters,
        }
        sim: dict[str, Any] = {'start': tuple(self._task.start.tolist())}
        if not options.lockstep:
            # The robot waits for its command, which waits for the planner.
            sim['patience'] = _CLOCK_PATIENCE
            shared['robot_interface'] = 'sim'
        own: dict[str, dict[str, Any]] = {
            'sim': sim,
            'controller': {'law': options.law, 'damping': self._damping},
            'planner': {'task': options.task},
        }
        nodes = self._task.nodes
        return {name: shared | given | dict(nodes.get(name, {})) for name, given in own.items()}


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
