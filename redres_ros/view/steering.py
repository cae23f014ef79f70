"""Steers the arm while the dead-man switch of the page is held: by jogging, or by the mouse."""

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from typing import Any

import numpy as np
import viser
from geometry_msgs.msg import PoseStamped, TwistStamped
from rclpy.node import Node

from redres_ros.graph.client import CallError
from redres_ros.graph.monitor import GraphMonitor
from redres_ros.nodes.conversions import to_pose
from redres_ros.nodes.topics import MODE, PUBLISH, REASON
from redres_ros.nodes.wire import TwistWriter
from redres_ros.robot_model import RobotModel
from redres_ros.rotation import from_quaternion, to_quaternion
from redres_ros.types import JointPositions, Seconds
from redres_ros.view.controls import Bindings, notify
from redres_ros.view.scene import ArmScene
from redres_ros.view.server import DeadMan

_NOW = 0  # a stamp that means: as soon as it comes
_PERIOD = 0.02  # [s] between task velocities
_LAST_ZEROS = 0.3  # [s] for which zeros follow a motion; then others may have the topic
_PATIENCE = 0.5  # [s] in which the arm begins to move
_AXES = ('x', 'y', 'z')
_VIEW = 'turns the view'
_DRAG = 'drags the tip'
_PUSH = 'pushes a link'
_END = 'end'  # of the phases of a drag
_HANDLE = 0.25  # size, for an arm that reaches 1 m
_SPRING = 300.0  # [N/m] from the point that was taken to the mouse
_FORCE = 40.0  # [N] at first
_MOST_FORCE = 200.0  # [N]
_SPEED = (0.05, 0.5)  # [m/s] at first, and at most
_TURN = (0.3, 2.0)  # [rad/s]
_PUSH_TIME = 0.4  # [s] of a push by a button
_LED = {'mass': (5.0, 0.05), 'damping': (30.0, 1.0), 'stiffness': (0.0, 0.0), 'force': (0.0, 0.0)}
_HINTS = {
    'inactive': 'the controller is inactive; activate it first',
    'mirroring': 'the robot takes no commands at present',
    'holding': 'the controller holds: "resume" lets it go on',
}


class TwistPublisher:
    """Publishes on `cartesian_velocity`, and nothing while no velocity is asked for.

    When a motion begins it stops the planner, which would pull the tip back to its path or goal.
    """

    def __init__(self, node: Node, stop_planner: Callable[[], object]) -> None:
        self._writer = TwistWriter('')
        self._publisher = node.create_publisher(TwistStamped, 'cartesian_velocity', PUBLISH)
        self._stop_planner = stop_planner
        self._moved_at = -np.inf  # [s] when the task velocity was last not zero

    def publish(self, dx: np.ndarray, now: Seconds) -> None:
        """Publish a task velocity (6,) [m/s], [rad/s], unless none was asked for lately."""
        if dx.any():
            if now - self._moved_at >= _LAST_ZEROS:
                self._stop_planner()
            self._moved_at = now
        if now - self._moved_at < _LAST_ZEROS:
            self._publisher.publish(self._writer.written(_NOW, dx))

    def stop(self) -> None:
        """Publish a zero task velocity, if there was another."""
        if np.isfinite(self._moved_at):
            self._publisher.publish(self._writer.written(_NOW, np.zeros(6)))

    def listeners(self) -> int:
        """Number of its subscribers."""
        return self._publisher.get_subscription_count()


class TipHandle:
    """A handle at the tip: while it is dragged, its pose is streamed on `target_pose`."""

    def __init__(
        self,
        server: viser.ViserServer,
        monitor: GraphMonitor,
        model: RobotModel,
        turns: bool,
        is_held: Callable[[], bool],
    ) -> None:
        self.is_dragged = False
        self._model = model
        self._is_held = is_held
        self._publisher = monitor.create_publisher(PoseStamped, 'target_pose', PUBLISH)
        self.handle = server.scene.add_transform_controls(
            '/tip_handle',
            scale=_HANDLE * model.reach,
            disable_rotations=not turns,
            depth_test=False,
            visible=False,
        )
        self.handle.on_update(self.on_update)

    def follow(self, q: JointPositions) -> None:
        """Keep it at the tip, unless it is dragged."""
        if self.handle.visible and not self.is_dragged:
            x, R = self._model.tip(q)
            self.handle.position = x
            self.handle.wxyz = np.roll(to_quaternion(R), 1)

    # In viser's own loop, which keeps the phases in their order.
    async def on_update(self, event: Any) -> None:
        """Publish the pose to which it is dragged."""
        if event.phase == _END or not self._is_held():
            self.is_dragged = False
            return
        if event.phase == 'start' and not self._publisher.get_subscription_count():
            notify(event, 'no planner listens to target_pose; start one, to drag the tip')
            return
        self.is_dragged = True
        R = from_quaternion(np.roll(self.handle.wxyz, -1))
        self._publisher.publish(to_pose(_NOW, '', np.array(self.handle.position), R))


class LinkPush:
    """Links that can be taken with the mouse, which pulls at them like a spring.

    Attributes:
        largest: Allowed force [N].
        force: In the frame of the base, (3,) [N].
        link: That it acts on; empty: the tip.
        event: The last one, from the browser that pushes.
    """

    def __init__(self, scene: ArmScene, is_held: Callable[[], bool]) -> None:
        self.largest = _FORCE
        self.force = np.zeros(3)
        self.link = ''
        self.event: Any = None
        self._scene = scene
        self._is_held = is_held

    def set_active(self, active: bool) -> None:
        """Let the links be taken, or not."""
        for link, mesh in self._scene.meshes:
            mesh.remove_drag_callback()
            if active:
                mesh.on_drag('left')(self.callback(link))

    def callback(self, link: str) -> Callable[[Any], Any]:
        """What follows a drag at a link."""

        async def on_drag(event: Any) -> None:
            self.event = event
            if event.phase == _END or not self._is_held():
                self.force = np.zeros(3)
                return
            self.link = link
            self.force = pull(event.start_position, event.end_position, self.largest)

        return on_drag


def pull(taken: Any, mouse: Any, largest: float) -> np.ndarray:
    """The force of a spring between two points (3,) [m], not larger than allowed, (3,) [N]."""
    force = _SPRING * (np.array(mouse) - np.array(taken))
    size = float(np.linalg.norm(force))
    return force * min(1.0, largest / size) if size > 0.0 else force


class Steering:
    """What an operator does to the arm by hand, while the switch is held.

    Attributes:
        rows: Rows of a task velocity, 3 or 6.
        tip: The handle at the tip.
        link: The pushed link.
        twists: The jogged velocities; None before the first motion.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        monitor: GraphMonitor,
        bindings: Bindings,
        scene: ArmScene,
        model: RobotModel,
        dead_man: DeadMan,
    ) -> None:
        self._monitor = monitor
        self._bindings = bindings
        self._dead_man = dead_man
        self.rows = 6 if bindings.values['controller']['task_space'] == 'pose' else 3
        self.twists: TwistPublisher | None = None
        self._asked_at = 0.0  # [s] since when a velocity is asked for; 0: none is
        self._was_dragged = False
        self._pushed = np.zeros(3)  # sent to the robot last [N]
        self._orders = ThreadPoolExecutor(max_workers=1)
        self._order: Future[Any] | None = None  # under way
        self.tip = TipHandle(server, monitor, model, self.rows == 6, self._is_held)
        self.link = LinkPush(scene, self._is_held)
        self._add_inputs(server.gui)
        if bindings.values['sim']:
            self._add_push(server.gui, model.links)

    def run(self, stopped: threading.Event) -> None:
        """Steer until the event is set; then the arm is neither moved nor pushed any more."""
        while not stopped.wait(_PERIOD):
            self.step(time.monotonic())
        if self.twists is not None:
            self.twists.stop()
        self._orders.shutdown()
        if self._pushed.any():
            with suppress(CallError):
                self._set_force(np.zeros(3), self.link.link)

    def step(self, now: Seconds) -> None:
        """Publish what is asked for."""
        direction = self._dead_man.direction(now)
        if direction is None:
            self.tip.is_dragged = False
            self.link.force = np.zeros(3)
            direction = np.zeros(6)
        if direction.any():
            self._asked_at = self._asked_at or now
            self.twists = self.twists or TwistPublisher(
                self._monitor, lambda: self._orders.submit(self._stop_task)
            )
        else:
            self._asked_at = 0.0
        if self.twists is not None:
            speeds = np.repeat((self._speed.value, self._turn.value), 3)
            self.twists.publish(direction * speeds, now)
        if self._order is None or self._order.done():
            self._order = self._next_order()

    def status(self) -> str:
        """Why the arm does not move although it is asked to; empty if nothing is known."""
        if not self._asked_at or time.monotonic() - self._asked_at < _PATIENCE:
            return ''
        if self.twists is not None and not self.twists.listeners():
            return 'no controller listens to cartesian_velocity'
        reason = self._monitor.word(REASON)
        if reason:
            return f'the robot has stopped: {reason}; "reset the robot" lets it go on'
        return _HINTS.get(self._monitor.word(MODE), '')

    def _is_held(self) -> bool:
        return self._dead_man.direction(time.monotonic()) is not None

    def _next_order(self) -> Future[Any] | None:
        """Begin the next call of a service; of several forces the newest counts."""
        if self._was_dragged != self.tip.is_dragged:
            self._was_dragged = self.tip.is_dragged
            if not self._was_dragged:
                return self._orders.submit(self._stop_task)
        force = self.link.force
        if np.array_equal(force, self._pushed):
            return None
        return self._orders.submit(self._push_link, force, self.link.link)

    def _stop_task(self) -> None:
        with suppress(CallError):  # there may be no planner
            self._bindings.client.trigger('planner/stop')

    def _push_link(self, force: np.ndarray, link: str) -> None:
        try:
            self._set_force(force, link)
        except CallError as error:
            self.link.force = self._pushed
            notify(self.link.event, str(error))
        else:
            self._pushed = force

    def _set_force(self, force: np.ndarray, link: str) -> None:
        values = {'push_link': link, 'push_force': force.tolist()}
        self._bindings.client.set_parameters('sim', values)

    def _push_for_a_moment(self, event: Any, force: np.ndarray, link: str) -> None:
        try:
            self._set_force(force, link)
            time.sleep(_PUSH_TIME)
            self._set_force(np.zeros(3), link)
        except CallError as error:
            notify(event, str(error))

    def _add_inputs(self, gui: viser.GuiApi) -> None:
        enabled = 'admittance.enabled'
        has_sim = bool(self._bindings.values['sim'])
        with gui.add_folder('move by hand'):
            mouse = gui.add_dropdown('the mouse', (_VIEW, _DRAG, *((_PUSH,) if has_sim else ())))
            self._speed = gui.add_slider('speed [m/s]', 0.005, _SPEED[1], 0.005, _SPEED[0])
            self._turn = gui.add_slider('turning [rad/s]', 0.05, _TURN[1], 0.05, _TURN[0])
            self._turn.visible = self.rows == 6
            led: Any = gui.add_checkbox(
                'lead by hand',
                self._bindings.values['controller'][enabled],
                hint='admittance: the tip yields to the measured wrench (5 kg, 30 N s/m)',
            )
        mouse.on_update(self._on_mouse)
        led.on_update(self._on_led)
        self._bindings.on_change('controller', enabled, lambda value: setattr(led, 'value', value))

    def _on_mouse(self, event: Any) -> None:
        self.tip.handle.visible = event.target.value == _DRAG
        self.link.set_active(event.target.value == _PUSH)

    def _on_led(self, event: Any) -> None:
        """Have the tip yield to a hand, or no longer."""
        values: dict[str, Any] = {'admittance.enabled': event.target.value}
        if event.target.value:
            for name, (linear, angular) in _LED.items():
                values[f'admittance.{name}'] = [linear] * 3 + [angular] * (self.rows - 3)
        self._bindings.set(event, 'controller', values)

    def _add_push(self, gui: viser.GuiApi, links: tuple[str, ...]) -> None:
        """Add what pushes a link of the fake robot by a button, with the mouse's largest force."""
        with gui.add_folder('push the fake robot'):
            pushed = self._bindings.values['sim']['push_link']
            link = gui.add_dropdown('link (none: tip)', ('', *links), initial_value=pushed)
            self._bindings.add(link, 'sim', 'push_link')
            force = gui.add_slider('force [N]', 0.0, _MOST_FORCE, 5.0, initial_value=_FORCE)
            buttons = gui.add_button_group('0.4 s along', _AXES)
        force.on_update(lambda event: setattr(self.link, 'largest', event.target.value))

        def push(event: Any) -> None:
            along = force.value * np.eye(3)[_AXES.index(event.target.value)]
            self._orders.submit(self._push_for_a_moment, event, along, link.value)

        buttons.on_click(push)
