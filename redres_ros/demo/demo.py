"""`redres demo`: the three nodes as processes, a task from start to end, and its results."""

import signal
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from redres_ros.demo.observation import Log, replay
from redres_ros.demo.outcome import Outcome, motion_values
from redres_ros.demo.processes import GraphError, NodeProcess
from redres_ros.files.processes import handled
from redres_ros.graph.client import CallError
from redres_ros.graph.monitor import GraphMonitor
from redres_ros.laws import Law
from redres_ros.loop.modes import COMMANDING
from redres_ros.nodes.runtime import spun
from redres_ros.nodes.topics import REASON, SESSION
from redres_ros.planning.task_executor import TaskState
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.closed_loop import PATIENCE
from redres_ros.simulation.report import label

# [s] from starting the processes to command mode, and to the first motion. The first start after an
# installation compiles what keeps the limits; on a busy machine that takes most of a minute.
START_PATIENCE = 120.0

_SILENCE = 10.0  # [s] without a state after which the robot counts as lost
_SETTLING = 0.3  # [s] that the arm is still watched at the last point
_FINISHED = TaskState.FINISHED.value
_ASK_AGAIN = 0.5  # [s] after a start that was refused
_LOOK = 0.02  # [s] between looks at the state
_DISCOVERY = 0.5  # [s] from which on the nodes know that their telemetry has a subscriber
_RESPONSE = 30.0  # [s] for the response of a node that is there, and may stall
# [s] that an ordinary machine may stall; the fake arm's clock then stands still
_CLOCK_PATIENCE = 5.0
_PAGE = 'view.page'  # module that serves the page
_ADDRESS = 'page: '  # how the line begins in which it reports its address


@dataclass
class Demo:
    """One run of the three nodes in the ROS domain that the environment names."""

    task: WaypointTask  # what the planner node runs, by the name in its parameter `task`
    model: RobotModel
    make_law: Callable[[str], Law]  # gives the law of a name, with the gains of the run
    parameters: Mapping[str, Any]  # of the nodes; each takes those that it has
    out: Path  # directory for what the nodes print
    # Parameters of the page, with which the nodes stay until Ctrl-C; None for no page
    page: Mapping[str, Any] | None = None
    interrupted: bool = field(default=False, init=False)  # whether Ctrl-C has ended the task

    def __post_init__(self) -> None:
        self._T = 1.0 / self.parameters['rate']
        self._nodes: list[NodeProcess] = []
        self._page: NodeProcess | None = None
        self._page_address = ''
        self._log = Log(self.model.joint_names)
        self._newest_at = 0.0  # when the newest state came [s]

    @property
    def title(self) -> str:
        law = label(self.make_law(self.parameters['law']))
        limits = ', '.join(self.parameters['limits'])
        return f'{law} at {self.parameters["rate"]:g} Hz, limits: {limits}'

    def run(self, progress: Callable[[float], None]) -> None:
        """Run the processes until their end or Ctrl-C; `progress` receives the fraction done.

        Raises GraphError, CallError if a node does not run, respond, or take a command.
        """
        try:
            with spun(lambda: GraphMonitor('demo', patience=_RESPONSE)) as monitor, self._running():
                if self.page is not None:
                    # While the nodes start: the Ctrl-C that ends a page would leave it half loaded.
                    import_module('redres_ros.simulation.plots')
                self._await_robot(monitor)
                self._run_task(monitor, progress)
                if self._page is not None:
                    self._stay(monitor, self._page)
        except KeyboardInterrupt:
            self.interrupted = not self._log.ending()  # after that the arm was only watched

    @contextmanager
    def _running(self) -> Iterator[None]:
        """The nodes and the page while the block runs.

        The sim ends first of the nodes: to be left alone by the controller would be a fault of its
        connection. The others end at once, before they miss its states.
        """
        try:
            parameters = self._node_parameters()
            for name in ('sim', 'controller', 'planner'):
                self._nodes.append(NodeProcess(name, self.out / f'{name}.log', parameters))
            if self.page is not None:
                self._page = NodeProcess(_PAGE, self.out / f'{_PAGE}.log', self.page)
            yield
        finally:
            # A second signal must not leave a process behind.
            with handled(signal.SIG_IGN, signal.SIGINT, signal.SIGTERM):
                if self._page:
                    self._page.end()
                for node in self._nodes:
                    node.interrupt()
                for node in self._nodes:
                    node.end()

    def _node_parameters(self) -> dict[str, Any]:
        parameters = {'start': tuple(self.task.start.tolist()), **self.parameters}
        if not parameters['lockstep']:
            # The robot waits for its command, which waits for the planner.
            parameters |= {'patience': _CLOCK_PATIENCE, 'robot_interface': 'sim'}
        for own in self.task.nodes.values():
            parameters |= own
        return parameters

    def _await_robot(self, monitor: GraphMonitor) -> None:
        until = time.monotonic() + START_PATIENCE
        while not self._is_ready(monitor):
            self._look(monitor)
            if time.monotonic() > until:
                raise GraphError(
                    f'the robot took no commands within {START_PATIENCE:g} s; see {self.out}/*.log'
                )
            time.sleep(_LOOK)
        time.sleep(_DISCOVERY)

    def _is_ready(self, monitor: GraphMonitor) -> bool:
        """Whether the planner is there and the robot takes commands, or waits in lock-step."""
        if not monitor.count_services('planner/start'):
            return False
        if self.parameters['lockstep']:
            topics = ('joint_command', 'cartesian_velocity')
            return bool(self._log.newest) and all(map(monitor.count_publishers, topics))
        return monitor.word(SESSION) in COMMANDING

    def _run_task(self, monitor: GraphMonitor, progress: Callable[[float], None]) -> None:
        """Run the task until it has ended, the robot is stopped, or a time limit."""
        self._start_task(monitor)
        events = sorted(self.task.events, key=lambda event: event.at)
        nominal = self.task.segments * self.task.segment_time
        t = 0.0
        while t < PATIENCE * nominal and not self._log.ending():
            self._look(monitor)
            if monitor.word(REASON):
                return
            t = (self._log.newest - self._log.began) / 1e9
            while events and t >= events[0].at:
                event = events.pop(0)
                monitor.client.set_parameters(event.node, dict(event.parameters))
            progress(min(t / nominal, 1.0))
            time.sleep(_LOOK)
        time.sleep(_SETTLING)
        self._look(monitor)
        if self._log.ending() != _FINISHED:
            reasons = [f'{node}: {report.text}' for node, report in monitor.health().items()]
            print('; '.join(('the task was not finished', *reasons)), flush=True)

    def _start_task(self, monitor: GraphMonitor) -> None:
        """Wait until the task begins, or the robot is stopped; the planner may refuse at first."""
        until = time.monotonic() + START_PATIENCE
        is_granted = False
        refusal = ''
        while not self._log.began and not monitor.word(REASON):
            if time.monotonic() > until:
                raise GraphError(f'the planner did not begin within {START_PATIENCE:g} s{refusal}')
            if not is_granted:
                try:
                    monitor.client.trigger('planner/start')
                    is_granted = True
                except CallError as error:
                    refusal = f': {error}'
            time.sleep(_LOOK if is_granted else _ASK_AGAIN)
            self._look(monitor)

    def _stay(self, monitor: GraphMonitor, page: NodeProcess) -> None:
        """Keep the nodes until Ctrl-C, here an ordinary end, or until the page ends."""
        self._log.close(monitor.samples)
        try:
            while page.status() is None:
                self._check_processes()
                time.sleep(_LOOK)
        except KeyboardInterrupt:
            return

    def _look(self, monitor: GraphMonitor) -> None:
        """Take what has come. Raises GraphError if the run cannot go on."""
        self._check_processes()
        before = self._log.newest
        self._log.collect(monitor.samples)
        now = time.monotonic()
        if not before or self._log.newest != before:
            self._newest_at = now
        if now - self._newest_at > _SILENCE:
            raise GraphError(f'no state from the robot for {_SILENCE:g} s; see {self.out}/*.log')

    def _check_processes(self) -> None:
        """Report the page's address, once. Raises GraphError if a process has ended."""
        for node in self._nodes:
            node.check()
        if self._page and self._page.status():
            self._page.check()
        if self._page and not self._page_address:
            self._page_address = self._page.last_line().partition(_ADDRESS)[2]
            if self._page_address:
                print(f'page {self._page_address} (the nodes stay until Ctrl-C)', flush=True)

    def outcome(self) -> Outcome:
        log = self._log
        pose = self.task.orientations is not None
        recording = replay(log, self.model, self.make_law, self._T, pose)
        summary: dict[str, Any] = {
            'task': 'finished' if recording.finished else 'NOT finished',
            'stop_reason': log.stopped()[1],
            'session': log.words(SESSION),
        }
        if self.interrupted:
            summary['task'] = 'interrupted'
        stamps = log.under_way()
        if len(recording.data):
            tip = self.model.tip(log.states[max(log.states)])[0]
            error = float(np.linalg.norm(tip - self.task.waypoints[-1]))
            summary['motion'] = motion_values(recording, self.task, error)
        rows = [
            ((stamp - stamps[0]) / 1e9, *(self.model.tip(log.states[stamp])[1] @ log.forces[stamp]))
            for stamp in stamps
            if stamp in log.forces
        ]
        return Outcome(recording, summary, np.array(rows).reshape(-1, 4))
