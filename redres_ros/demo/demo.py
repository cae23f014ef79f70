"""`redres demo`: the three nodes as processes, a task from start to end, and its results."""

import time
from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time

from redres_ros.demo.observation import Log, count_cycles, replay
from redres_ros.demo.outcome import Outcome, motion_values, pressing_values
from redres_ros.demo.processes import DemoOptions, NodeGroup
from redres_ros.errors import RedresError
from redres_ros.graph.client import CallError
from redres_ros.graph.monitor import GraphMonitor
from redres_ros.laws import Law
from redres_ros.loop.session import COMMANDING
from redres_ros.nodes.controller import ControllerParameters
from redres_ros.nodes.runtime import spun
from redres_ros.nodes.topics import LATCHED, REASON, SESSION, TASK_BEGUN, TASK_STATE
from redres_ros.nodes.wire import to_nanoseconds
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


class DemoError(RedresError):
    """A run that could not begin, or failed."""


class _DemoMonitor(GraphMonitor):
    """Observes a demo's nodes: what they report, and how far the robot's clock is."""

    def __init__(self, log: Log) -> None:
        super().__init__('demo', patience=_RESPONSE)
        self.log = log
        self.newest_at = time.monotonic()  # when the newest state came [s]
        self.began = 0  # stamp at which a task began last [ns]; 0 before the first
        self.look()
        self.create_subscription(Time, TASK_BEGUN, self._on_begun, LATCHED)

    def look(self) -> None:
        """Take what has come."""
        before = self.log.newest
        self.log.collect(self.samples)
        if self.log.newest != before:
            self.newest_at = time.monotonic()

    def has_ended(self, since: float) -> bool:
        """Whether a task has ended, finished or given up, since an instant [s]."""
        last = self.values.get(TASK_STATE)
        under_way = [state.value for state in UNDER_WAY]
        return last is not None and last.at > since and last.value not in under_way

    def _on_begun(self, message: Time) -> None:
        self.began = to_nanoseconds(message)


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
        self._out = out
        check_parameters(ControllerParameters(rate=options.rate))
        self._T = 1.0 / options.rate
        for name in (options.law, *(name for name, _ in options.switches)):
            law(name).check_damping(self._T)
        self._node_group = NodeGroup(options, task, law(options.law).damping, out)
        self._log = Log(model.joint_names)
        self._report: Callable[[str], None] = print
        self._page = ''  # where it is served
        self._endurance: dict[str, Any] | None = None
        self.interrupted = False

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
            with spun(partial(_DemoMonitor, self._log)) as monitor, self._node_group.running():
                self._await_robot(monitor)
                self._run_task(monitor, progress)
                if self.options.duration:
                    self._repeat(monitor, progress)
                if self.options.page is not None:
                    self._stay(monitor)
        except KeyboardInterrupt:
            self.interrupted = True

    def _await_robot(self, monitor: _DemoMonitor) -> None:
        until = time.monotonic() + START_PATIENCE
        while not self._is_ready(monitor):
            self._check(monitor)
            if time.monotonic() > until:
                raise DemoError(
                    f'the robot took no commands within {START_PATIENCE:g} s; see {self._out}/*.log'
                )
            time.sleep(_LOOK)
        time.sleep(_DISCOVERY)

    def _is_ready(self, monitor: _DemoMonitor) -> bool:
        """Whether the planner is there and the robot takes commands, or waits in lock-step."""
        if not monitor.count_services('planner/start'):
            return False
        if self.options.lockstep:
            topics = ('joint_command', 'cartesian_velocity')
            return bool(self._log.newest) and all(map(monitor.count_publishers, topics))
        return monitor.word(SESSION) in COMMANDING

    def _run_task(self, monitor: _DemoMonitor, progress: Callable[[float], None]) -> None:
        """Run the task until it is finished, the robot is stopped, or a time limit."""
        called = time.monotonic()
        self._start_task(monitor)
        switches = [TaskEvent(t, 'controller', {'law': law}) for law, t in self.options.switches]
        events = sorted((*switches, *self.task.events), key=lambda event: event.at)
        nominal = self.task.segments * self.task.segment_time
        t = 0.0
        while t < PATIENCE * nominal and not monitor.has_ended(called):
            self._check(monitor)
            if monitor.word(REASON):
                return
            t = (self._log.newest - monitor.began) / 1e9
            while events and t >= events[0].at:
                event = events.pop(0)
                monitor.client.set_parameters(event.node, dict(event.parameters))
            progress(min(t / nominal, 1.0))
            time.sleep(_LOOK)
        time.sleep(_SETTLING)
        self._check(monitor)
        if monitor.word(TASK_STATE) != _FINISHED:
            reasons = [f'{node}: {text}' for node, text in monitor.health().items()]
            self._report('; '.join(('the task was not finished', *reasons)))

    def _start_task(self, monitor: _DemoMonitor) -> None:
        """Wait until the task begins, or the robot is stopped; the planner may refuse at first."""
        before = monitor.began
        until = time.monotonic() + START_PATIENCE
        is_granted = False
        refusal = ''
        while monitor.began == before and not monitor.word(REASON):
            self._check(monitor)
            if time.monotonic() > until:
                raise DemoError(f'the planner did not begin within {START_PATIENCE:g} s{refusal}')
            if not is_granted:
                try:
                    monitor.client.trigger('planner/start')
                    is_granted = True
                except CallError as error:
                    refusal = f': {error}'
            time.sleep(_LOOK if is_granted else _ASK_AGAIN)

    def _repeat(self, monitor: _DemoMonitor, progress: Callable[[float], None]) -> None:
        """Repeat the task, each round from where the last one ended."""
        before = {node.name: node.memory() for node in self._node_group.nodes}
        duration = self.options.duration
        first = monitor.began

        def seconds() -> float:
            return (self._log.newest - first) / 1e9

        rounds = 1
        while monitor.word(TASK_STATE) == _FINISHED and seconds() < duration:
            self._run_task(monitor, lambda _: progress(min(seconds() / duration, 1.0)))
            rounds += 1
        memory = {node.name: (before[node.name], node.memory()) for node in self._node_group.nodes}
        self._endurance = {'rounds': rounds, 'seconds': seconds(), 'memory': memory}

    def _stay(self, monitor: _DemoMonitor) -> None:
        """Keep the nodes until Ctrl-C, here an ordinary end, or until the page ends."""
        self._log.close(monitor.samples)
        try:
            # Load the plotting libraries now, not after Ctrl-C.
            import_module('redres_ros.simulation.plots')
            while self._node_group.page_is_served():
                self._check(monitor)
                time.sleep(_LOOK)
        except KeyboardInterrupt:
            return

    def _check(self, monitor: _DemoMonitor) -> None:
        self._node_group.check()
        monitor.look()
        if not self._page:
            self._page = self._node_group.page_address()
            if self._page:
                self._report(f'page {self._page} (the nodes stay until Ctrl-C)')
        if self._log.newest and time.monotonic() - monitor.newest_at > _SILENCE:
            raise DemoError(f'no state from the robot for {_SILENCE:g} s; see {self._out}/*.log')

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
