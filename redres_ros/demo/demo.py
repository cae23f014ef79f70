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

from redres_ros.demo.observation import Log, count_cycles, replay
from redres_ros.demo.outcome import Outcome, motion_values, pressing_values
from redres_ros.demo.processes import NodeProcess
from redres_ros.errors import RedresError
from redres_ros.files.processes import handled
from redres_ros.graph.client import CallError
from redres_ros.graph.monitor import GraphMonitor
from redres_ros.laws import Law
from redres_ros.loop.modes import COMMANDING
from redres_ros.nodes.controller import ControllerParameters
from redres_ros.nodes.runtime import spun
from redres_ros.nodes.topics import REASON, SESSION, TASK_STATE
from redres_ros.parameter import check_parameters
from redres_ros.planning.task_executor import UNDER_WAY, TaskState
from redres_ros.planning.waypoints import TaskEvent, WaypointTask
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.closed_loop import PATIENCE

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


class DemoError(RedresError):
    """A run that could not begin, or failed."""


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


class Demo:
    """One run of the three nodes in the ROS domain that the environment names.

    Args:
        options: What to run.
        task: The one that the options name.
        model: Of the arm that carries it out.
        law: Gives the law of a name, with the gains of the run.
        out: Directory for what the nodes print.

    Attributes:
        interrupted: Whether Ctrl-C has ended it.

    Raises:
        UnknownNameError, RangeError: A law, damping or rate that the nodes would refuse.
    """

    def __init__(
        self,
        options: DemoOptions,
        task: WaypointTask,
        model: RobotModel,
        law: Callable[[str], Law],
        out: Path,
    ) -> None:
        self.options = options
        self.task = task
        self.model = model
        self.law = law
        self.interrupted = False
        self._out = out
        check_parameters(ControllerParameters(rate=options.rate))
        self._T = 1.0 / options.rate
        for name in (options.law, *(name for name, _ in options.switches)):
            law(name).check_damping(self._T)
        self._nodes: list[NodeProcess] = []
        self._page: NodeProcess | None = None
        self._page_address = ''
        self._log = Log(model.joint_names)
        self._newest_at = 0.0  # when the newest state came [s]
        self._report: Callable[[str], None] = print
        self._endurance: dict[str, Any] | None = None

    @property
    def title(self) -> str:
        """Law, rate, and the law's parameters, if they matter to it."""
        law = self.law(self.options.law)
        title = f'{self.options.law} at {self.options.rate:g} Hz'
        if law.has_memory:
            title += f', k_d = {law.damping:g} 1/s, λ = {law.forgetting_factor(self._T):g}'
        return title

    def run(self, progress: Callable[[float], None], report: Callable[[str], None]) -> None:
        """Run from the start of the processes to their end; Ctrl-C ends it early.

        Args:
            progress: Called with the fraction done, 0 to 1.
            report: Takes a line for the user.

        Raises:
            DemoError, GraphError, CallError: A node does not run, respond, or take a command.
        """
        self._report = report
        try:
            with spun(lambda: GraphMonitor('demo', patience=_RESPONSE)) as monitor, self._running():
                self._await_robot(monitor)
                self._run_task(monitor, progress)
                if self.options.duration:
                    self._repeat(monitor, progress)
                if self._page is not None:
                    self._stay(monitor, self._page)
        except KeyboardInterrupt:
            self.interrupted = True

    @contextmanager
    def _running(self) -> Iterator[None]:
        """The nodes and the page while the block runs.

        The sim ends first of the nodes: to be left alone by the controller would be a fault of its
        connection.
        """
        try:
            for name, parameters in self._parameters().items():
                self._nodes.append(NodeProcess(name, self._out / f'{name}.log', parameters))
            if self.options.page is not None:
                self._page = NodeProcess(_PAGE, self._out / f'{_PAGE}.log', self.options.page)
            yield
        finally:
            # A second signal must not leave a process behind.
            with handled(signal.SIG_IGN, signal.SIGINT, signal.SIGTERM):
                if self._page:
                    self._page.end()
                for node in self._nodes:
                    node.end()

    def _parameters(self) -> dict[str, dict[str, Any]]:
        """Parameters of each process, by its name."""
        options = self.options
        shared = {
            'lockstep': options.lockstep,
            'rate': options.rate,
            'robot': self.task.robot,
            'dynamics': options.dynamics,
            **options.parameters,
        }
        sim: dict[str, Any] = {'start': tuple(self.task.start.tolist())}
        if not options.lockstep:
            # The robot waits for its command, which waits for the planner.
            sim['patience'] = _CLOCK_PATIENCE
            shared['robot_interface'] = 'sim'
        own: dict[str, dict[str, Any]] = {
            'sim': sim,
            'controller': {'law': options.law, 'damping': self.law(options.law).damping},
            'planner': {'task': options.task},
        }
        together: dict[str, Any] = {}
        for name in own:
            own[name] = {**shared, **own[name], **self.task.nodes.get(name, {})}
            together |= own[name]
        return {'composed': together} if options.composed else own

    def _await_robot(self, monitor: GraphMonitor) -> None:
        until = time.monotonic() + START_PATIENCE
        while not self._is_ready(monitor):
            self._look(monitor)
            if time.monotonic() > until:
                raise DemoError(
                    f'the robot took no commands within {START_PATIENCE:g} s; see {self._out}/*.log'
                )
            time.sleep(_LOOK)
        time.sleep(_DISCOVERY)

    def _is_ready(self, monitor: GraphMonitor) -> bool:
        """Whether the planner is there and the robot takes commands, or waits in lock-step."""
        if not monitor.count_services('planner/start'):
            return False
        if self.options.lockstep:
            topics = ('joint_command', 'cartesian_velocity')
            return bool(self._log.newest) and all(map(monitor.count_publishers, topics))
        return monitor.word(SESSION) in COMMANDING

    def _run_task(self, monitor: GraphMonitor, progress: Callable[[float], None]) -> None:
        """Run the task until it has ended, the robot is stopped, or a time limit."""
        called = time.monotonic()
        self._start_task(monitor)
        switches = [TaskEvent(t, 'controller', {'law': law}) for law, t in self.options.switches]
        events = sorted((*switches, *self.task.events), key=lambda event: event.at)
        nominal = self.task.segments * self.task.segment_time
        t = 0.0
        while t < PATIENCE * nominal and not _has_ended(monitor, called):
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
        if monitor.word(TASK_STATE) != _FINISHED:
            reasons = [f'{node}: {text}' for node, text in monitor.health().items()]
            self._report('; '.join(('the task was not finished', *reasons)))

    def _start_task(self, monitor: GraphMonitor) -> None:
        """Wait until the task begins, or the robot is stopped; the planner may refuse at first."""
        before = self._log.began
        until = time.monotonic() + START_PATIENCE
        is_granted = False
        refusal = ''
        while self._log.began == before and not monitor.word(REASON):
            if time.monotonic() > until:
                raise DemoError(f'the planner did not begin within {START_PATIENCE:g} s{refusal}')
            if not is_granted:
                try:
                    monitor.client.trigger('planner/start')
                    is_granted = True
                except CallError as error:
                    refusal = f': {error}'
            time.sleep(_LOOK if is_granted else _ASK_AGAIN)
            self._look(monitor)

    def _repeat(self, monitor: GraphMonitor, progress: Callable[[float], None]) -> None:
        """Repeat the task, each round from where the last one ended."""
        before = {node.name: node.memory() for node in self._nodes}
        duration = self.options.duration
        first = self._log.began

        def seconds() -> float:
            return (self._log.newest - first) / 1e9

        rounds = 1
        while monitor.word(TASK_STATE) == _FINISHED and seconds() < duration:
            self._run_task(monitor, lambda _: progress(min(seconds() / duration, 1.0)))
            rounds += 1
        memory = {node.name: (before[node.name], node.memory()) for node in self._nodes}
        self._endurance = {'rounds': rounds, 'seconds': seconds(), 'memory': memory}

    def _stay(self, monitor: GraphMonitor, page: NodeProcess) -> None:
        """Keep the nodes until Ctrl-C, here an ordinary end, or until the page ends."""
        self._log.close(monitor.samples)
        try:
            # Load the plotting libraries now, not after Ctrl-C.
            import_module('redres_ros.simulation.plots')
            while page.status() is None:
                self._look(monitor)
                time.sleep(_LOOK)
        except KeyboardInterrupt:
            return

    def _look(self, monitor: GraphMonitor) -> None:
        """Take what has come. Raises DemoError, GraphError if the run cannot go on."""
        for node in self._nodes:
            node.check()
        before = self._log.newest
        self._log.collect(monitor.samples)
        now = time.monotonic()
        if not before or self._log.newest != before:
            self._newest_at = now
        if now - self._newest_at > _SILENCE:
            raise DemoError(f'no state from the robot for {_SILENCE:g} s; see {self._out}/*.log')
        if self._page and self._page.status():
            self._page.check()
        if self._page and not self._page_address:
            self._page_address = self._page.last_line().partition(_ADDRESS)[2]
            if self._page_address:
                self._report(f'page {self._page_address} (the nodes stay until Ctrl-C)')

    def outcome(self) -> Outcome:
        """The outcome of the run."""
        log = self._log
        pose = self.options.parameters.get('task_space') == 'pose'
        recording = replay(log, self.model, self.law, self._T, pose)
        _, reason = log.stopped()
        motion = None
        cycles = None
        stamps = log.under_way()
        if len(recording.data):
            tip = self.model.tip(log.states[max(log.states)])[0]
            error = float(np.linalg.norm(tip - self.task.waypoints[-1]))
            motion = motion_values(recording, self.task, error)
            period = np.inf if self.options.lockstep else self._T
            cycles = count_cycles(log, period, stamps[0], stamps[-1])
        rows = [
            ((stamp - stamps[0]) / 1e9, *(self.model.tip(log.states[stamp])[1] @ log.forces[stamp]))
            for stamp in stamps
            if stamp in log.forces
        ]
        forces = np.array(rows).reshape(-1, 4)
        desired_force = self.task.nodes.get('controller', {}).get('admittance.force', ())
        return Outcome(
            recording,
            reason,
            log.words(SESSION),
            motion,
            pressing_values(forces, desired_force),
            cycles,
            self._endurance,
            planner_missed=len(set(stamps) - log.desired.keys()),
            switches=log.switches(),
            interrupted=self.interrupted,
            forces=forces,
        )


def _has_ended(monitor: GraphMonitor, since: float) -> bool:
    """Whether a task has ended, finished or given up, since an instant [s]."""
    last = monitor.values.get(TASK_STATE)
    under_way = [state.value for state in UNDER_WAY]
    return last is not None and last.at > since and last.value not in under_way
