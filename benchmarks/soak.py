"""Three nodes for a long time, while parts of the graph fail in random order.

    python benchmarks/soak.py --minutes 30 --seed 1 --out redres_soak

Nodes are killed, stalled and cut off, laws, limits, preferences and gains are switched, the arm is
held and reset, messages get lost and late. After every event the graph has to come back: command
mode, and an arm that moves; if that takes a reset or a start, that is done. What every node said is
judged all the time. The last line is `sound` if nothing was wrong.
"""

import argparse
import json
import math
import os
import random
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from redres_ros.demo.processes import NodeProcess
from redres_ros.graph.client import CallError, GraphClient
from redres_ros.laws import LAWS
from redres_ros.nodes.runtime import own_domain, spun
from redres_ros.nodes.topics import LATCHED
from redres_ros.preferences import PREFERENCES
from redres_ros.robots import find_arm
from redres_ros.robots.joint_limits import JointLimits

RATE = 100.0  # [Hz], so that it is the faults that count and not the machine
PATIENCE = 60.0  # [s] for the graph to come back
OVERSHOOT = 1.2  # of servos, beside encoder noise
MOVING = 1e-3  # [rad/s] of the fastest joint
PARAMETERS: dict[str, dict[str, Any]] = {
    'sim': {'rate': RATE},
    'controller': {'rate': RATE},
    'planner': {'rate': RATE, 'task': 'side_to_side', 'autostart': True},
}
LIMITS = JointLimits.of(find_arm('lwr4_paper'))


class SoakError(Exception):
    """The graph did not come back."""


@dataclass
class Books:
    """What was seen."""

    states: int = 0
    commands: int = 0
    not_finite: int = 0
    too_fast: int = 0  # commands with a joint above its velocity limit
    outside: int = 0  # references outside the joint ranges
    leaps: int = 0  # states to which the arm cannot have got at its velocity limits
    stops: Counter[str] = field(default_factory=Counter)
    events: Counter[str] = field(default_factory=Counter)
    recoveries: dict[str, list[float]] = field(default_factory=dict)  # [s] by event
    resets: int = 0

    @property
    def sound(self) -> bool:
        """Whether nothing was wrong."""
        return not self.not_finite + self.too_fast + self.outside + self.leaps


class Judge(Node):
    """Listens to robot and controller, and keeps the books."""

    def __init__(self) -> None:
        super().__init__('judge')
        self.books = Books()
        self.session = ''
        self.reason = ''
        self.planner = ''
        self._last: tuple[float, np.ndarray] | None = None
        self._moved = 0.0  # when the arm last moved in command mode [s]
        everything = QoSProfile(depth=2000)
        self.create_subscription(JointState, 'joint_states', self._on_state, everything)
        self.create_subscription(JointState, 'joint_command', self._on_command, everything)
        self.create_subscription(String, 'sim/session_state', self._on_session, LATCHED)
        self.create_subscription(String, 'sim/stop_reason', self._on_reason, LATCHED)
        self.create_subscription(String, 'planner/state', self._on_planner, LATCHED)

    def moved_since(self, then: float) -> bool:
        """Whether the arm has moved in command mode after an instant [s]."""
        return self._moved > then

    def _on_state(self, message: JointState) -> None:
        self.books.states += 1
        q = np.array(message.position)
        stamp = message.header.stamp.sec + message.header.stamp.nanosec * 1e-9
        if not np.isfinite(q).all():
            self.books.not_finite += 1
        if self._last and 0.0 < stamp - self._last[0] < 0.1:
            speeds = np.abs(q - self._last[1]) / (stamp - self._last[0])
            speed = float(speeds.max())
            self.books.leaps += int((speeds > OVERSHOOT * LIMITS.velocity).any())
            if speed > MOVING and self.session == 'CMD':
                self._moved = time.monotonic()
        self._last = (stamp, q)

    def _on_command(self, message: JointState) -> None:
        books = self.books
        books.commands += 1
        q_ref = np.array(message.position)
        dq = np.array(message.velocity)
        if not (np.isfinite(q_ref).all() and np.isfinite(dq).all()):
            books.not_finite += 1
        books.too_fast += int((np.abs(dq) > LIMITS.velocity * (1.0 + 1e-9)).any())
        books.outside += int(((q_ref < LIMITS.lower) | (q_ref > LIMITS.upper)).any())

    def _on_session(self, message: String) -> None:
        self.session = message.data

    def _on_reason(self, message: String) -> None:
        if message.data and message.data != self.reason:
            self.books.stops[message.data.partition(':')[0]] += 1
        self.reason = message.data

    def _on_planner(self, message: String) -> None:
        self.planner = message.data


class Soak:
    """The graph, and what is done to it.

    Args:
        judge: Listens.
        chance: Chooses.
        folder: For the nodes' logs.
    """

    def __init__(self, judge: Judge, chance: random.Random, folder: Path) -> None:
        self._judge = judge
        self._client = GraphClient(judge)
        self._chance = chance
        self._folder = folder
        self._started: Counter[str] = Counter()
        self.nodes = {name: self._start(name) for name in PARAMETERS}
        self._events: dict[str, Callable[[], None]] = {
            'controller killed': lambda: self._kill('controller'),
            'planner killed': lambda: self._kill('planner'),
            'robot killed': lambda: self._kill('sim'),
            'controller stalled': lambda: self._stall('controller'),
            'planner stalled': lambda: self._stall('planner'),
            'robot stalled': lambda: self._stall('sim'),
            'cable cut': self._cut,
            'messages disturbed': self._disturb,
            'law switched': self._switch_law,
            'limits switched': self._switch_limits,
            'preferences switched': self._switch_preferences,
            'refused parameters': self._refused,
            'held': self._hold,
            'task stopped': lambda: self._call(Trigger, 'planner/stop'),
            'robot reset': lambda: self._call(Trigger, 'sim/reset'),
        }

    def run(self, seconds: float) -> None:
        """One event after the other. Raises SoakError if the graph does not come back."""
        books = self._judge.books
        until = time.monotonic() + seconds
        self._come_back()
        while time.monotonic() < until:
            name = self._chance.choice(list(self._events))
            books.events[name] += 1
            self._try(self._events[name])
            began = time.monotonic()
            self._come_back()
            books.recoveries.setdefault(name, []).append(time.monotonic() - began)
            for node in self.nodes.values():
                node.check()
            time.sleep(self._chance.uniform(0.2, 1.5))

    def _come_back(self) -> None:
        """Wait until the arm moves in command mode, and do what a user would do for it."""
        began = time.monotonic()
        asked = began
        while not self._judge.moved_since(began + 0.1):
            time.sleep(0.05)
            now = time.monotonic()
            if now - began > PATIENCE:
                raise SoakError(
                    f'after {PATIENCE:g} s: session {self._judge.session}, '
                    f'{self._judge.reason or "not stopped"}, planner {self._judge.planner}'
                )
            if now - asked < 1.0:
                continue
            asked = now
            if self._judge.reason:
                self._judge.books.resets += 1
                self._try(lambda: self._call(Trigger, 'sim/reset'))
            elif self._judge.planner in ('idle', 'finished'):
                self._try(lambda: self._call(Trigger, 'planner/start'))

    def _try(self, act: Callable[[], None]) -> None:
        """Services may be gone for the moment; coming back decides."""
        try:
            act()
        except CallError as error:
            self._judge.books.events[f'no command: {str(error)[:60]}'] += 1

    def _call(self, kind: type, service: str, **request: Any) -> None:
        self._client.call(kind, service, kind.Request(**request))  # type: ignore[attr-defined]

    def _set(self, node: str, **values: Any) -> None:
        self._client.set_parameters(node, values)

    def _start(self, name: str) -> NodeProcess:
        self._started[name] += 1
        log = self._folder / f'{name}_{self._started[name]}.log'
        return NodeProcess(name, log, PARAMETERS[name])

    def _kill(self, name: str) -> None:
        os.kill(self.nodes[name].pid, signal.SIGKILL)
        self.nodes[name].wait(10.0)
        time.sleep(self._chance.uniform(0.0, 1.0))
        self.nodes[name] = self._start(name)

    def _stall(self, name: str) -> None:
        os.kill(self.nodes[name].pid, signal.SIGSTOP)
        time.sleep(self._chance.uniform(0.02, 1.5))
        os.kill(self.nodes[name].pid, signal.SIGCONT)

    def _cut(self) -> None:
        self._set('sim', state_loss=1.0, command_loss=1.0)
        time.sleep(self._chance.uniform(0.05, 1.5))
        self._set('sim', state_loss=0.0, command_loss=0.0)

    def _disturb(self) -> None:
        share = self._chance.uniform(0.0, 0.3)
        faults = {
            'state_loss': share,
            'command_loss': share,
            'disorder': share,
            'command_delay': self._chance.randint(0, 2),
            'encoder_noise': self._chance.uniform(0.0, 1e-4),
        }
        self._set('sim', **faults)
        time.sleep(self._chance.uniform(0.2, 2.0))
        self._set('sim', **{name: type(value)(0) for name, value in faults.items()})

    def _switch_law(self) -> None:
        damping = self._chance.uniform(1.0, 50.0)
        self._set('controller', law=self._chance.choice(list(LAWS)), damping=damping)

    def _switch_limits(self) -> None:
        limits = ['position', 'velocity', 'acceleration']
        if self._chance.random() < 0.3:
            limits.append('torque')
        self._set('controller', limits=limits, limit_scale=self._chance.uniform(0.5, 1.0))

    def _switch_preferences(self) -> None:
        names = self._chance.sample(list(PREFERENCES), self._chance.randint(1, 2))
        self._set('controller', preferences=names)

    def _refused(self) -> None:
        bad = ({'law': 'none'}, {'damping': math.nan}, {'limits': ['speed']}, {'rate': 1.0})
        try:
            self._set('controller', **self._chance.choice(bad))
        except CallError:
            return
        raise SoakError('a parameter that cannot be was taken')

    def _hold(self) -> None:
        self._call(SetBool, 'controller/hold', data=True)
        time.sleep(self._chance.uniform(0.1, 1.0))
        self._call(SetBool, 'controller/hold', data=False)

    def assert_quiet_logs(self) -> None:
        """Raise SoakError for a traceback in a log."""
        for path in self._folder.glob('*.log'):
            if 'Traceback' in path.read_text(errors='replace'):
                raise SoakError(f'a traceback in {path}')


def main() -> int:
    """0 if all was well."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])  # type: ignore[union-attr]
    parser.add_argument('--minutes', type=float, default=30.0)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--out', type=Path, default=Path('redres_soak'))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    began = time.monotonic()
    trouble = ''
    with own_domain(), spun(Judge) as judge:
        soak = Soak(judge, random.Random(options.seed), options.out)
        try:
            soak.run(60.0 * options.minutes)
            soak.assert_quiet_logs()
        except Exception as error:  # noqa: BLE001, told below, with the figures
            trouble = f'{type(error).__name__}: {error}'
        finally:
            for node in soak.nodes.values():
                node.end()
    books = judge.books
    figures = {
        'minutes': round((time.monotonic() - began) / 60.0, 2),
        **{name: value for name, value in vars(books).items() if name != 'recoveries'},
        'longest recovery [s]': {
            name: round(max(values), 2) for name, values in sorted(books.recoveries.items())
        },
        'trouble': trouble,
    }
    print(json.dumps(figures, indent=2))
    sound = judge.books.sound and not trouble
    print('sound' if sound else 'NOT sound')
    return 0 if sound else 1


if __name__ == '__main__':
    sys.exit(main())
