"""Receives commands: which state each one belongs to, or why it is refused."""

import math
import time
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from redres_ros.errors import JointNamesError
from redres_ros.fake_robot.faults import NetworkModel
from redres_ros.fake_robot.robot import ClientCommand, FakeRobot
from redres_ros.fake_robot.robot_clock import NANOSECONDS, RobotClock
from redres_ros.fake_robot.session import CommandError
from redres_ros.fake_robot.timing import WINDOW
from redres_ros.types import JointPositions, Nanoseconds, Seconds

_CONTEST = 1.0  # [s] for which publishers count as rivals after a state got two commands


class _ArrivedCommand(NamedTuple):
    stamp: Nanoseconds  # of the state that it is for
    names: Sequence[str]
    positions: np.ndarray  # [rad], one for each name, if all is well
    time: Seconds  # on the monotonic clock
    tick: int = 0  # at which it entered the robot's network


class CommandReceiver:
    """Checks what clients send: valid commands go to the robot, its session counts the others.

    The subscriber calls `put`, in any thread; the robot's loop calls `take`. Unless timed, as in
    lock-step, latencies are not measured.
    """

    def __init__(self, robot: FakeRobot, clock: RobotClock, *, timed: bool = True) -> None:
        # How many are in the graph. While more than one sends commands, none is taken. One that was
        # killed stays in the graph for some 20 s, but is silent.
        self.publishers = 1
        self.newest: Nanoseconds = 0  # stamp of the state that the last command was for
        self.network: NetworkModel[_ArrivedCommand] = NetworkModel('0 commands')
        self._robot = robot
        self._clock = clock
        self._timed = timed
        self._arrivals: deque[_ArrivedCommand] = deque()
        self._contested_at = -math.inf  # [s] when a state last got a second command
        self._newest_tick = -1  # of a valid command

    def put(self, stamp: Nanoseconds, names: Sequence[str], positions: np.ndarray) -> None:
        """Take positions in any order, sent for the state of a stamp."""
        now = time.monotonic()
        if stamp <= self.newest:
            self._contested_at = now
        self.newest = stamp
        self._arrivals.append(_ArrivedCommand(stamp, names, positions, now))

    def take(self) -> list[ClientCommand]:
        """The valid commands since the last call, ordered by tick; of two for a state the first."""
        tick = self._robot.tick
        while self._arrivals:
            self.network.send(self._arrivals.popleft()._replace(tick=tick), tick)
        commands = []
        for arrival in self.network.receive(tick):
            try:
                command = self._judge(arrival, tick)
            except CommandError as error:
                self._robot.session.refuse(error)
                continue
            if command.tick > self._newest_tick:
                self._newest_tick = command.tick
                commands.append(command)
        return commands

    def _judge(self, arrival: _ArrivedCommand, now: int) -> ClientCommand:
        """What arrived as the command for a state, judged at tick `now`. Raises CommandError."""
        if self.publishers > 1 and time.monotonic() - self._contested_at < _CONTEST:
            raise CommandError(
                'second publisher',
                f'joint_command has {self.publishers} publishers that send commands; allowed: 1',
            )
        tick = self._tick_of(arrival.stamp, now)
        q = self._positions(arrival)
        if not self._timed:
            return ClientCommand(tick, q)
        # [s] by faults, after it had come
        delayed = (now - arrival.tick) * self._clock.period / NANOSECONDS
        return ClientCommand(tick, q, self._clock.latency(arrival.stamp, arrival.time + delayed))

    def _tick_of(self, stamp: Nanoseconds, now: int) -> int:
        """The tick of a stamp, before `now`: that state is not out yet. Raises CommandError."""
        tick = self._clock.tick(stamp)
        if tick is None or tick >= now:
            raise CommandError('for no state', f'stamp {stamp} ns is that of no state sent so far')
        command = f'command for tick {tick} at tick {now}'
        if tick < now - 1 - WINDOW:
            raise CommandError('out of date', f'{command}, more than {WINDOW} cycles late')
        if tick < self._newest_tick:
            raise CommandError('out of order', f'{command}, after one for tick {self._newest_tick}')
        return tick

    def _positions(self, arrival: _ArrivedCommand) -> JointPositions:
        """Commanded positions in the order of the arm's joints. Raises CommandError."""
        names = arrival.names
        expected = self._robot.plant.joint_names
        if sorted(names) != sorted(expected):
            raise CommandError('wrong joint names', str(JointNamesError(names, expected)))
        if arrival.positions.shape != (len(names),):
            raise CommandError(
                'wrong length',
                f'got {arrival.positions.size} positions; expected {len(names)}, one a joint',
            )
        q = np.array([arrival.positions[names.index(name)] for name in expected])
        if not np.isfinite(q).all():
            raise CommandError('not finite', f'got {q.tolist()} rad; expected finite values')
        return q
