"""`redres demo`: the three nodes as processes, a task from start to end, and what came of it."""

import signal
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from std_srvs.srv import Trigger

from redres_ros.demo.client import call, set_parameters
from redres_ros.demo.processes import NodeProcess
from redres_ros.demo.recorder import Recorder
from redres_ros.demo.replay import Log, replay
from redres_ros.errors import RedresError
from redres_ros.laws import Law, law_name, make_law
from redres_ros.nodes.controller import COMMANDING, ControllerParameters
from redres_ros.nodes.runtime import spun
from redres_ros.parameter import check_parameters
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.closed_loop import PATIENCE
from redres_ros.simulation.recording import Recording
from redres_ros.waypoints import WaypointTask

START_PATIENCE = 30.0  # [s] from starting the processes to command mode
SILENCE = 10.0  # [s] without a state after which the robot counts as lost
# [s] that an ordinary machine may stall; the fake arm's clock then stands still
CLOCK_PATIENCE = 5.0
MOST_GROWTH = 5.0  # [MB] of a node's memory while it does the same again and again
SETTLING = 0.3  # [s] that the arm is still watched at the last point

_LOOK = 0.02  # [s] between looks at the state of things
_LAST_WORDS = 0.3  # [s] for the messages that the nodes send when they end


class DemoError(RedresError):
    """A run that came to nothing."""


@dataclass(frozen=True)
class DemoOptions:
    """What to run.

    dynamics: of the fake arm and of the controller's model; switches: (law, seconds after the task
    began); parameters: more of them, for every node that has them; composed: one process instead of
    three; duration [s]: repeat the task for so long, 0 for once.
    """

    task: str
    law: str
    damping: float
    rate: float
    dynamics: str = 'identified'
    switches: tuple[tuple[str, float], ...] = ()
    lockstep: bool = False
    composed: bool = False
    duration: float = 0.0
    parameters: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Endurance:
    """What came of repeating a task.

    seconds: on the robot's clock; states_sent, states_heard: by the robot and by the listener of
    the demo; memory: of each node's process after the first round and at the end [MB].
    """

    rounds: int
    seconds: float
    states_sent: int
    states_heard: int
    memory: Mapping[str, tuple[float, float]]

    @property
    def steady(self) -> bool:
        """Whether no process has grown by more than is usual for an interpreter that has not seen
        everything yet.
        """
        return all(end - start < MOST_GROWTH for start, end in self.memory.values())

    @property
    def lines(self) -> list[tuple[str, str]]:
        """For the table that ends a demo."""
        return [
            ('rounds', f'{self.rounds} in {self.seconds:.0f} s'),
            ('states', f'{self.states_sent} sent, {self.states_heard} heard by this listener'),
            *(
                (
                    f'memory of {name}',
                    f'{start:.1f} MB after the first round, {end:.1f} MB at the end',
                )
                for name, (start, end) in self.memory.items()
            ),
        ]


@dataclass(frozen=True)
class Outcome:
    """What came of it.

    stop_reason: the robot's own words, empty if it was not stopped; states: those of the session,
    as they were passed through; final_error: from the tip to the last point, when the run ended
    [m]; figures: the sim's last diagnostics.
    """

    recording: Recording
    law: Law
    stop_reason: str
    states: tuple[str, ...]
    final_error: float
    figures: dict[str, str]
    endurance: Endurance | None = None

    @property
    def succeeded(self) -> bool:
        """Whether the last point was reached by a robot that was not stopped, and no node has
        grown.
        """
        steady = self.endurance is None or self.endurance.steady
        return self.recording.finished and not self.stop_reason and steady

    @property
    def title(self) -> str:
        """Law, damping and rate in words."""
        T = self.recording.T
        law = self.law
        return f'{law_name(law)}, $k_d$ = {law.damping:g} 1/s ($\\lambda$ = {law.forgetting(T):g}), {1.0 / T:g} Hz'

    def table(self) -> str:
        """The summary that ends a demo."""
        figures = self.figures
        recording = self.recording
        cycles = int(figures.get('cycles', 0))
        waited = sum(int(figures.get(name, 0)) for name in ('late', 'missed', 'cycles waited for'))
        share = 1.0 - waited / max(cycles, 1)
        stood = float(figures.get('clock stood still [s]', 0.0))
        begun = 0
        end = 0.0
        peak = {}
        if len(recording.data):
            begun = int(recording['segment'].max())
            end = recording['t'][-1]
            peak = {
                name: recording.peak(f'joint_{name}_norm')
                for name in ('acceleration', 'velocity', 'torque')
            }
        lines = [
            ('task', 'finished' if self.succeeded else 'NOT finished'),
            ('robot', f'stopped: {self.stop_reason}' if self.stop_reason else 'not stopped'),
            ('session states', ' > '.join(self.states)),
            ('segments begun', f'{begun} in {end:.3f} s'),
            ('error at the end', f'{1e3 * self.final_error:.3f} mm'),
            *(
                (f'largest joint {name}', f'{value:.3f} at {t:.3f} s')
                for name, (value, t) in peak.items()
            ),
            ('cycles', f'{cycles}, of which {cycles - waited} were answered in time ({share:.1%})'),
            (
                'of the others',
                ', '.join(
                    f'{figures.get(name, 0)} {name}' for name in ('late', 'missed', 'bridged')
                ),
            ),
            ("robot's clock", f'stood still for {stood:.3f} s, waiting for late answers'),
            *(self.endurance.lines if self.endurance else ()),
        ]
        return '\n'.join(f'{label:<28}{text}' for label, text in lines)


class Demo:
    """One run of the three nodes in the ROS domain that the environment names; out: directory for
    what the nodes print.

    Raises UnknownNameError or RangeError for a law, damping or rate that the nodes would refuse.
    """

    def __init__(self, options: DemoOptions, task: WaypointTask, out: Path) -> None:
        self._options = options
        self._task = task
        self._out = out
        check_parameters(ControllerParameters(rate=options.rate))
        self.model = RobotModel.named(task.robot, dynamics=options.dynamics)
        self._T = 1.0 / options.rate
        self._laws = [(0, self._make_law(options.law))]  # stamp [ns] from which each is in force
        for law, _ in options.switches:
            self._make_law(law)
        self._nodes: list[NodeProcess] = []

    def run(self, progress: Callable[[float], None]) -> Outcome:
        """From starting the processes to ending them. Raises GraphError or CallError when that does
        not work.
        """
        with spun(lambda: Recorder(self.model.joint_names)) as recorder:
            with self._processes():
                self._await_robot(recorder)
                call(recorder, Trigger, 'planner/start', Trigger.Request())
                self._follow(recorder, progress)
                first_round = recorder.log
                begun = recorder.begun
                endurance = self._repeat(recorder, progress) if self._options.duration else None
            time.sleep(_LAST_WORDS)
        return self._outcome(recorder, first_round, begun, endurance)

    def _make_law(self, name: str) -> Law:
        law = make_law(name, damping=self._options.damping)
        law.check_damping(self._T)
        return law

    @contextmanager
    def _processes(self) -> Iterator[None]:
        """The sim ends first: to be left alone by the controller would be a fault of its
        connection.
        """
        options = self._options
        shared = {
            'lockstep': options.lockstep,
            'rate': options.rate,
            'robot': self._task.robot,
            'dynamics': options.dynamics,
            **options.parameters,
        }
        if options.lockstep:
            # Nobody keeps time, and the first state waits for the planner.
            shared['state_timeout'] = START_PATIENCE / 10.0
        sim = {'start': tuple(self._task.start.tolist())}
        sim |= {'monitor_time': 0.0} if options.lockstep else {'patience': CLOCK_PATIENCE}
        own = {
            'sim': sim,
            'controller': {'law': options.law, 'damping': options.damping},
            'planner': {'task': options.task},
        }
        if options.composed:
            own = {
                'composed': {
                    key: value for parameters in own.values() for key, value in parameters.items()
                }
            }
        try:
            for name, parameters in own.items():
                self._nodes.append(
                    NodeProcess(name, self._out / f'{name}.log', {**shared, **parameters})
                )
            yield
        finally:
            handler = signal.signal(
                signal.SIGINT, signal.SIG_IGN
            )  # a second Ctrl-C must not leave a process behind
            for node in self._nodes:
                node.end()
            signal.signal(signal.SIGINT, handler)

    def _await_robot(self, recorder: Recorder) -> None:
        until = time.monotonic() + START_PATIENCE
        while not self._ready(recorder):
            self._check(recorder)
            if time.monotonic() > until:
                raise DemoError(
                    f'the robot took no commands within {START_PATIENCE:g} s; see {self._out}/*.log'
                )
            time.sleep(_LOOK)

    def _ready(self, recorder: Recorder) -> bool:
        """Whether the task may begin: the robot is in command mode, or, in lock-step, waits for its
        first answer.
        """
        if self._options.lockstep:
            topics = ('joint_states', 'joint_command', 'cartesian_velocity')
            return bool(recorder.log.states) and all(
                recorder.count_publishers(topic) for topic in topics
            )
        # The recorder may find a node later than the nodes find each other; what it would miss is
        # the beginning.
        heard = bool(recorder.log.states and recorder.log.commands)
        return heard and any(
            state in COMMANDING for state in recorder.words['sim/session_state'][-1:]
        )

    def _follow(self, recorder: Recorder, progress: Callable[[float], None]) -> None:
        """Until the task is finished, the robot is stopped, or the task should have been finished
        long ago.
        """
        switches = sorted(self._options.switches, key=lambda pair: pair[1])
        nominal = self._task.segments * self._task.segment_time
        t = 0.0
        while t < PATIENCE * nominal and recorder.words['planner/state'][-1:] != ['finished']:
            self._check(recorder)
            if recorder.stopped:
                self._await_stamp(recorder)
                return
            t = recorder.seconds
            while switches and t >= switches[0][1]:
                self._switch(recorder, switches.pop(0)[0])
            progress(min(t / nominal, 1.0))
            time.sleep(_LOOK)
        time.sleep(SETTLING)

    def _repeat(self, recorder: Recorder, progress: Callable[[float], None]) -> Endurance:
        """The task again and again, from wherever the last round ended; only the first one stays
        recorded.
        """
        start = min(recorder.log.states)
        before = {node.name: node.memory for node in self._nodes}
        begun = recorder.begun
        duration = self._options.duration
        rounds = 1
        while not recorder.stopped and (recorder.newest - begun) / 1e9 < duration:
            recorder.log = Log({}, {})
            words = len(recorder.words['planner/state'])
            call(recorder, Trigger, 'planner/start', Trigger.Request())
            while len(recorder.words['planner/state']) == words:  # until it moves again
                self._check(recorder)
                time.sleep(_LOOK)
            self._follow(
                recorder, lambda _: progress(min((recorder.newest - begun) / 1e9 / duration, 1.0))
            )
            rounds += 1
        sent = round((recorder.newest - start) / 1e9 / self._T) + 1
        return Endurance(
            rounds,
            (recorder.newest - begun) / 1e9,
            sent,
            recorder.states_heard,
            {node.name: (before[node.name], node.memory) for node in self._nodes},
        )

    def _await_stamp(self, recorder: Recorder) -> None:
        """Until the robot has said when it stopped, which it does with its next diagnostics."""
        until = time.monotonic() + SILENCE
        while not recorder.stopped_at and time.monotonic() < until:
            self._check(recorder)
            time.sleep(_LOOK)

    def _switch(self, recorder: Recorder, law: str) -> None:
        set_parameters(recorder, 'controller', {'law': law})
        self._laws.append((recorder.newest, self._make_law(law)))

    def _check(self, recorder: Recorder) -> None:
        for node in self._nodes:
            node.check()
        if recorder.newest and time.monotonic() - recorder.heard > SILENCE:
            raise DemoError(
                f'nothing was heard of the robot for {SILENCE:g} s; see {self._out}/*.log'
            )

    def _outcome(
        self, recorder: Recorder, log: Log, begun: int, endurance: Endurance | None
    ) -> Outcome:
        reason = recorder.words['sim/stop_reason'][-1] if recorder.stopped else ''
        log = log.until(recorder.stopped_at or None)
        recording = replay(log, begun, self.model, self._task, self._laws, self._T, reason)
        return Outcome(
            recording,
            self._laws[0][1],
            reason,
            tuple(recorder.words['sim/session_state']),
            recorder.final_error(self.model, self._task),
            recorder.figures,
            endurance,
        )
