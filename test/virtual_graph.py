"""The three nodes in one process and in virtual time: no DDS, no waiting, the same every time.

The nodes are what they are in the field, callbacks and all. Only what ROS does for them is done
here: messages go over wires, on which faults can be put, timers run when their virtual time has
come, and services are called directly.
"""

import heapq
import inspect
import os
import re
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from itertools import count
from types import SimpleNamespace
from typing import Any, NamedTuple
from unittest import mock

import numpy as np
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from own_ros import ros
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.task import Future

from redres_ros.nodes.controller import ControllerNode
from redres_ros.nodes.planner import PlannerNode
from redres_ros.nodes.sim import SimNode

Fault = Callable[[Any, float], list[tuple[float, Any]]]  # message, now [s] -> (delay [s], message)

_BEGINNING = 1_000_000.0  # [s] of the virtual clock
FROZEN = os.environ.get('REDRES_FROZEN')  # where scripts/frozen has references written
EPOCH = 1_700_000_000 * 10**9  # [ns] at which it shows 0


def no_fault(message: Any, now: float) -> list[tuple[float, Any]]:
    return [(0.0, message)]


class VirtualTime:
    """A clock that advances on request, and what is due at which time."""

    def __init__(self) -> None:
        self.now = _BEGINNING
        self._due: list[tuple[float, int, Callable[[], object]]] = []
        self._number = count()

    def monotonic(self) -> float:
        return self.now

    def time_ns(self) -> int:
        """In the place of time.time_ns [ns]."""
        return EPOCH + round(1e9 * self.now)

    def call_in(self, delay: float, call: Callable[[], object]) -> None:
        """Have something called after a delay [s]; at once without one."""
        if delay <= 0.0:
            call()
        else:
            heapq.heappush(self._due, (self.now + delay, next(self._number), call))

    def repeat(self, period: float, call: Callable[[], object]) -> None:
        def again() -> None:
            call()
            self.call_in(period, again)

        self.call_in(period, again)

    def advance(self, seconds: float) -> None:
        """Let time pass, and what is due happen."""
        until = self.now + seconds
        while self._due and self._due[0][0] <= until:
            self.now, _, call = heapq.heappop(self._due)
            call()
        self.now = until


class _Receiver(NamedTuple):
    """A subscription: the node's name, what it calls with message and info, and its depth."""

    listener: str
    receive: Callable[[Any, dict[str, int]], None]
    depth: int


class Graph:
    """Wires between nodes, by topic; and the nodes' services by name.

    faults: by (topic, name of the listener). All listeners get the same message, which nobody may
    change. taps: see what arrives just before the listener does, by the same keys. What was
    published on the topics in `kept` is there, as (time [s], message).
    """

    def __init__(self) -> None:
        self.clock = VirtualTime()
        self.faults: dict[tuple[str, str], Fault] = {}
        self.taps: dict[tuple[str, str], Callable[[Any], None]] = {}
        self.kept: dict[str, list[tuple[float, Any]]] = {}
        self.services: dict[str, tuple[type, Callable[..., Any]]] = {}
        self.log: list[tuple[str, str]] = []  # (node, line)
        self._receivers: dict[str, list[_Receiver]] = {}
        self._latched: dict[str, tuple[Any, int]] = {}  # message, when it was published [ns]
        self._stalled: dict[str, dict[str, deque[Callable[[], None]]]] = {}  # by node and topic

    def listen(
        self, topic: str, listener: str, receive: Callable[..., None], depth: int = 1000
    ) -> _Receiver:
        """Add a listener, a node by its name, that takes the message, or the message and its info;
        a latched one reaches it at once. While its process is stalled so many are kept.
        """
        receiver = _Receiver(listener, _with_info(receive), depth)
        self._receivers.setdefault(topic, []).append(receiver)
        if topic in self._latched:
            self._deliver(topic, receiver, *self._latched[topic])
        return receiver

    def leave(self, topic: str, receiver: _Receiver) -> None:
        self._receivers[topic].remove(receiver)

    def stall(self, listener: str) -> None:
        """Stop a node's process, as SIGSTOP does: nothing reaches it, and its timers rest."""
        self._stalled[listener] = {}

    def resume(self, listener: str, first: str = '') -> None:
        """Let it go on, as SIGCONT does: what its subscriptions have kept reaches it now, that of
        the first topic before the others.
        """
        kept = self._stalled.pop(listener)
        for topic in sorted(kept, key=lambda topic: topic != first):
            for arrive in kept[topic]:
                arrive()

    def is_stalled(self, listener: str) -> bool:
        return listener in self._stalled

    def publish(
        self, topic: str, message: Any, *, latched: bool = False, kind: type | None = None
    ) -> None:
        """To every listener, as the faults on its wire will have it; a copy if it is of a kind."""
        if not latched and topic not in self._receivers and topic not in self.kept:
            return
        if kind:
            sent = message if isinstance(message, bytes) else serialize_message(message)
            message = deserialize_message(sent, kind)
        now = self.clock.time_ns()
        if latched:
            self._latched[topic] = (message, now)
        if topic in self.kept:
            self.kept[topic].append((self.clock.now, message))
        for receiver in self._receivers.get(topic, ()):
            self._deliver(topic, receiver, message, now)

    def listeners(self, topic: str) -> int:
        return len(self._receivers.get(topic, ()))

    def call(self, name: str, **request: Any) -> Any:
        kind, respond = self.services[name]
        return respond(kind.Request(**request), kind.Response())

    def _deliver(self, topic: str, receiver: _Receiver, message: Any, published: int) -> None:
        """Send a message, published at some time [ns], over one wire."""
        fault = self.faults.get((topic, receiver.listener), no_fault)
        for delay, arriving in fault(message, self.clock.now):
            arrive = partial(self._arrive, topic, receiver, arriving, published)
            self.clock.call_in(delay, arrive)

    def _arrive(self, topic: str, receiver: _Receiver, message: Any, published: int) -> None:
        stalled = self._stalled.get(receiver.listener)
        if stalled is not None:
            kept = stalled.setdefault(topic, deque(maxlen=receiver.depth))
            kept.append(partial(self._arrive, topic, receiver, message, published))
            return
        if tap := self.taps.get((topic, receiver.listener)):
            tap(message)
        received = self.clock.time_ns()
        info = {'source_timestamp': published, 'received_timestamp': received}
        receiver.receive(message, info)


def _with_info(receive: Callable[..., None]) -> Callable[[Any, dict[str, int]], None]:
    """A callback as rclpy would call it, which looks at how many arguments it takes."""
    try:
        inspect.signature(receive).bind(object())
    except TypeError:
        return receive
    return lambda message, info: receive(message)


class _Wired(Node):
    """Comes between a node's class and rclpy's: wires in the place of DDS."""

    graph: Graph

    def create_publisher(self, msg_type: Any, topic: str, qos: Any, **options: Any) -> Any:
        latched = getattr(getattr(qos, 'durability', 0), 'value', 0) == 1
        return _Wire(self.graph, msg_type, topic, latched)

    def create_subscription(
        self, msg_type: Any, topic: str, callback: Callable[..., None], qos: Any, **options: Any
    ) -> Any:
        depth = qos if isinstance(qos, int) else qos.depth

        def read(message: Any) -> None:
            callback(serialize_message(message))

        is_raw = options.get('raw', False)
        receiver = self.graph.listen(topic, self.get_name(), read if is_raw else callback, depth)
        return SimpleNamespace(topic_name=topic, qos_profile=qos, receiver=receiver)

    def destroy_subscription(self, subscription: Any) -> bool:
        self.graph.leave(subscription.topic_name, subscription.receiver)
        return True

    def create_timer(self, period: float, callback: Callable[[], object], **options: Any) -> Any:
        timer = _Timer()

        def unless_stalled() -> None:
            if not timer.cancelled and not self.graph.is_stalled(self.get_name()):
                callback()

        self.graph.clock.repeat(period, unless_stalled)
        return timer

    def create_service(
        self, kind: type, name: str, callback: Callable[..., Any], **options: Any
    ) -> Any:
        self.graph.services[name] = (kind, callback)

    def create_client(self, kind: type, name: str, **options: Any) -> Any:
        return _Client(self.graph, name)

    def count_publishers(self, topic: str) -> int:
        return 1

    def get_logger(self) -> Any:
        return _Logger(self.graph, self.get_name())


class _Timer:
    """In the place of a timer."""

    cancelled = False

    def cancel(self) -> None:
        self.cancelled = True


class _Client:
    """In the place of a client; its calls are served at once."""

    def __init__(self, graph: Graph, name: str) -> None:
        self._graph = graph
        self._name = name

    def service_is_ready(self) -> bool:
        return self._name in self._graph.services

    def call_async(self, request: Any) -> Future:
        kind, respond = self._graph.services[self._name]
        future = Future()
        future.set_result(respond(request, kind.Response()))
        return future


class _Wire:
    """In the place of a publisher."""

    def __init__(self, graph: Graph, kind: type, topic: str, latched: bool) -> None:
        self._graph = graph
        self._kind = kind
        self._topic = topic
        self._latched = latched

    def publish(self, message: Any) -> None:
        self._graph.publish(self._topic, message, latched=self._latched, kind=self._kind)

    def get_subscription_count(self) -> int:
        return self._graph.listeners(self._topic)


class _Logger:
    """Keeps the lines; which level they have does not matter here."""

    def __init__(self, graph: Graph, name: str) -> None:
        self._graph = graph
        self._name = name

    def info(self, line: str, **options: Any) -> None:
        self._graph.log.append((self._name, line))

    warning = info
    error = info


class _Cycles:
    """How the sim waits: virtual time goes on."""

    def __init__(self, clock: VirtualTime) -> None:
        self._clock = clock

    def wait(self, seconds: float, event: threading.Event | None = None) -> bool:
        """Let that much time pass; nobody sets the event any sooner."""
        self._clock.advance(seconds)
        return event is not None and event.is_set()


class VirtualRun:
    """Three nodes at work, by name, and the graph that they are wired by."""

    def __init__(self, graph: Graph, nodes: dict[str, Any]) -> None:
        self.graph = graph
        self.nodes = nodes
        self.references: list[np.ndarray] = []  # the robot's own, (n,) [rad], one a cycle
        robot = nodes['sim']._robot
        advance = robot.advance

        def advance_and_keep(*commands: Any) -> None:
            advance(*commands)
            self.references.append(robot.reference)

        robot.advance = advance_and_keep

    @property
    def now(self) -> float:
        return self.graph.clock.now - _BEGINNING

    @property
    def commanding(self) -> bool:
        """Whether the robot takes commands."""
        return bool(self.nodes['sim']._session.commanding)

    def set(self, node: str, **values: Any) -> bool:
        """Set parameters of a node, as somebody outside does; whether all were taken."""
        wanted = [Parameter(name, value=value) for name, value in values.items()]
        return all(result.successful for result in self.nodes[node].set_parameters(wanted))

    def change_state(self, node: str, transition: int) -> bool:
        """Ask a node for a transition of its life cycle, by its service; whether it was made."""
        service = self.nodes[node]._service_change_state
        request = ChangeState.Request(transition=Transition(id=transition))
        return bool(service.callback(request, ChangeState.Response()).success)

    def health(self, node: str) -> Any:
        """Its newest DiagnosticStatus; keep the topic /diagnostics first."""
        of_node = [
            message.status[0]
            for _, message in self.graph.kept['/diagnostics']
            if message.status[0].name.endswith(node)
        ]
        return of_node[-1]

    def run(self, seconds: float) -> None:
        stopped = threading.Event()
        self.graph.clock.call_in(seconds, stopped.set)
        self.nodes['sim'].run(stopped, _Cycles(self.graph.clock))

    def run_until(self, condition: Callable[[], bool], patience: float) -> bool:
        """Let it go on until a condition holds, but no longer than that [s]; whether it holds."""
        until = self.now + patience
        while not condition() and self.now < until:
            self.run(0.1)
        return condition()


# A robot that goes exactly where it is sent, and waits for nobody.
IDEAL = {'patience': 0.0, 'plant': 'ideal', 'monitor_time': 0.1}


@contextmanager
def virtual_run(
    rate: float = 100.0,
    robot: str = 'lwr4_paper',
    sim: Mapping[str, Any] = IDEAL,
    **parameters: Mapping[str, Any],
) -> Iterator[VirtualRun]:
    """The nodes of a robot, with further parameters by node, as planner={'autostart': True}."""
    words = []
    for node in ('sim', 'controller', 'planner'):
        given = sim if node == 'sim' else parameters.get(node, {})
        for name, value in {'rate': rate, 'robot': robot, **given}.items():
            words += ['-p', f'{node}:{name}:={_as_yaml(value)}']
    graph = Graph()
    if FROZEN:
        graph.kept['joint_command'] = []
    with on_wires(graph, (SimNode, ControllerNode, PlannerNode), *words) as nodes:
        try:
            yield VirtualRun(graph, nodes)
        finally:
            _freeze(graph)


@contextmanager
def on_wires(graph: Graph, classes: Iterable[type[Node]], *words: str) -> Iterator[dict[str, Any]]:
    """Nodes by name, made with words of a command line, in the virtual time of a graph."""
    nodes: dict[str, Any] = {}
    with (
        ros(*words),
        mock.patch.object(time, 'monotonic', graph.clock.monotonic),
        mock.patch.object(time, 'time_ns', graph.clock.time_ns),
    ):
        try:
            for cls in classes:
                node = type(cls.__name__, (cls, _Wired), {'graph': graph})()
                nodes[node.get_name()] = node
            yield nodes
        finally:
            for node in nodes.values():
                node.destroy_node()


def _freeze(graph: Graph) -> None:
    """Write the references that were published."""
    if FROZEN:
        name = re.sub(r'\W+', '_', os.environ['PYTEST_CURRENT_TEST'].partition('::')[2])
        published = [message.position for _, message in graph.kept['joint_command']]
        np.save(f'{FROZEN}/{name}.npy', np.array(published))


def _as_yaml(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
