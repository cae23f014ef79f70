"""The processes of a demo: their parameters, and the recordings that they write."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from redres_ros.demo.log import JUDGED
from redres_ros.demo.options import DemoOptions
from redres_ros.demo.processes import ALL, NodeProcess
from redres_ros.files.signals import handled
from redres_ros.laws import Law
from redres_ros.planning.waypoints import WaypointTask

_PAGE = 'view.serve'  # module that serves the page
_ADDRESS = 'page: '  # how the line begins in which it reports its address

_LOCKSTEP_SILENCE = 3.0  # [s] without a state that nodes tolerate in lock-step
# [s] that an ordinary machine may stall; the fake arm's clock then stands still
_CLOCK_PATIENCE = 5.0


class NodeGroup:
    """The nodes of one run, and the page that shows them.

    Args:
        options: The options of a run.
        task: The one that the options name.
        law: In force at the start.
        out: Directory for what they print, and for their recordings.
    """

    def __init__(self, options: DemoOptions, task: WaypointTask, law: Law, out: Path) -> None:
        self.nodes: list[NodeProcess] = []
        self._page: NodeProcess | None = None
        self._options = options
        self._task = task
        self._law = law
        self._out = out

    @contextmanager
    def running(self) -> Iterator[None]:
        """Processes while the block runs.

        They end in the order in which they were started, the sim first: to be left alone by the
        controller would be a fault of its connection.
        """
        self.remove_recordings()  # those of a run that was killed
        topics = (ALL,) if self._options.mcap else JUDGED
        try:
            for name, own in self._processes().items():
                log = self._out / f'{name}.log'
                path = self._recording(name)
                self.nodes.append(NodeProcess(name, log, own, recording=path, topics=topics))
            if self._options.page is not None:
                self._page = NodeProcess(_PAGE, self._out / f'{_PAGE}.log', self._options.page)
            yield
        finally:
            # A second signal must not leave a process behind.
            with handled(signal.SIG_IGN, signal.SIGINT, signal.SIGTERM):
                pages = [self._page] if self._page else []
                for page in pages:
                    page.ask_to_end()  # nobody waits for it
                for process in (*self.nodes, *pages):
                    process.end()

    def check(self) -> None:
        """Raise GraphError if a node has ended, or the page has failed."""
        for node in self.nodes:
            node.check()
        if self._page and self._page.status:
            self._page.check()

    @property
    def is_watched(self) -> bool:
        """Whether the page is served."""
        return self._page is not None and self._page.status is None

    @property
    def page(self) -> str:
        """Where the page is served; empty before it is."""
        return self._page.last_line().partition(_ADDRESS)[2] if self._page else ''

    @property
    def recordings(self) -> list[Path]:
        """The files that were begun, the robot's first."""
        return [path for path in map(self._recording, self._processes()) if path.exists()]

    def remove_recordings(self) -> None:
        """Remove them; they are of use for the outcome only."""
        for path in self.recordings:
            path.unlink(missing_ok=True)

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
        """Of each node, by its name."""
        options = self._options
        shared = {
            'lockstep': options.lockstep,
            'rate': options.rate,
            'robot': self._task.robot,
            'dynamics': options.dynamics,
            **options.parameters,
        }
        sim: dict[str, Any] = {'start': tuple(self._task.start.tolist())}
        if options.lockstep:
            # The first state waits for the planner.
            shared['state_timeout'] = _LOCKSTEP_SILENCE
        else:
            # The robot waits for its command, which waits for the planner.
            sim['patience'] = _CLOCK_PATIENCE
            shared['twist_patience'] = _CLOCK_PATIENCE
        own: dict[str, dict[str, Any]] = {
            'sim': sim,
            'controller': {'law': options.law, 'damping': self._law.damping},
            'planner': {'task': options.task},
        }
        if options.teleop:
            own['operator'] = own.pop('planner') | {'duration': options.teleop}
        nodes = self._task.nodes
        return {name: shared | given | dict(nodes.get(name, {})) for name, given in own.items()}

    def _recording(self, name: str) -> Path:
        return self._out / f'{name}.part.mcap'
