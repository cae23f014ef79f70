"""Moves the arm while the dead-man switch of the page is held: by jogging, or by the mouse."""

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from typing import Any

import numpy as np
import viser
from geometry_msgs.msg import PoseStamped, TwistStamped
from rclpy.publisher import Publisher

from redres_ros.geometry import from_quaternion, to_quaternion
from redres_ros.graph.client import CallError
from redres_ros.graph.monitor import GraphMonitor
from redres_ros.nodes.conversions import to_pose, to_twist
from redres_ros.nodes.topics import MODE, PUBLISH, REASON
from redres_ros.robot_model import RobotModel
from redres_ros.types import JointPositions, Seconds, Twist
from redres_ros.view.controls import Bindings, notify
from redres_ros.view.scene import ArmScene
from redres_ros.view.server import TeleopChannel

_NOW = 0  # a stamp that means: as soon as it comes
_PERIOD = 0.02  # [s] between task velocities
_LAST_ZEROS = 0.3  # [s] for which zeros follow a motion; then others may have the topic
_PATIENCE = 0.5  # [s] in which the arm begins to move
_VIEW = 'turns the view'
_DRAG = 'drags the tip'
_PUSH = 'pushes a link'
_END = 'end'  # of the phases of a drag
_HANDLE = 0.25  # size, for an arm that reaches 1 m
_SPRING = 300.0  # [N/m] from the point that was taken to the mouse
_FORCE = (40.0, 200.0)  # [N] largest at first, and at most
_SPEED = (0.05, 0.5)  # [m/s] at first, and at most
_TURN = (0.3, 2.0)  # [rad/s]
_LED = {'mass': (5.0, 0.05), 'damping': (30.0, 1.0), 'stiffness': (0.0, 0.0), 'force': (0.0, 0.0)}
_ENABLED = 'admittance.enabled'
_HINTS = {
    'inactive': 'the controller is inactive; activate it first',
    'mirroring': 'the robot takes no commands at present',
    'holding': 'the controller holds: "resume" lets it go on',
}


class Teleoperation:
    """What an operator does to the arm by hand, while the switch is held.

    A jogged velocity goes to `cartesian_velocity`; while none is asked for, nothing is published.
    The pose of the handle at the tip goes to `target_pose` while it is dragged. A link of the fake
    robot can be taken with the mouse, which pulls at it like a spring.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        monitor: GraphMonitor,
        bindings: Bindings,
        scene: ArmScene,
        model: RobotModel,
        channel: TeleopChannel,
    ) -> None:
        self._rows = 6 if bindings.values['controller']['task_space'] == 'pose' else 3
        self._channel = channel
        channel.rows = self._rows
        channel.status = self._status
        self._monitor = monitor
        self._bindings = bindings
        self._scene = scene
        self._model = model
        self._twist_publisher: Publisher | None = None  # made for the first motion
        self._target_publisher = monitor.create_publisher(PoseStamped, 'target_pose', PUBLISH)
        self._asked_at = 0.0  # [s] since when a velocity is asked for; 0: none is
        self._moved_at = -np.inf  # [s] when one was asked for last
        self._is_dragged = False
        self._must_stop = False  # the planner is to end its motion
        self._push: tuple[str, np.ndarray] = ('', np.zeros(3))  # wanted: link, and force [N]
        self._pushed = np.zeros(3)  # force set last [N]
        self._push_event: Any = None  # from the browser that pushes
        self._orders = ThreadPoolExecutor(max_workers=1)
        self._order: Future[None] | None = None  # under way
        self._handle = server.scene.add_transform_controls(
            '/tip_handle',
            scale=_HANDLE * model.reach,
            disable_rotations=self._rows == 3,
            depth_test=False,
            visible=False,
        )
        self._handle.on_update(self._on_drag)
        self._add_inputs(server.gui)

    def run(self, stopped: threading.Event) -> None:
        """Run until the event is set; then the arm is neither moved nor pushed any more."""
        while not stopped.wait(_PERIOD):
            self.step(time.monotonic())
        if self._twist_publisher is not None:
            self._twist_publisher.publish(to_twist(_NOW, '', np.zeros(6)))
        self._orders.shutdown()
        if self._pushed.any():
            self._push_link('', np.zeros(3))

    def step(self, now: Seconds) -> None:
        """Publish what is asked for."""
        direction = self._channel.direction(now)
        if direction is None:
            self._end_drag()
            self._push = ('', np.zeros(3))
            direction = np.zeros(6)
        self._jog(direction * np.repeat((self._speed.value, self._turn.value), 3), now)
        if self._order is None or self._order.done():
            self._order = self._next_order()

    def _status(self) -> str:
        """Why the arm does not move although it is asked to; empty if nothing is known."""
        if not self._asked_at or time.monotonic() - self._asked_at < _PATIENCE:
            return ''
        if self._twist_publisher and not self._twist_publisher.get_subscription_count():
            return 'no controller listens to cartesian_velocity'
        reason = self._monitor.word(REASON)
        if reason:
            return f'the robot has stopped: {reason}; "reset the robot" lets it go on'
        return _HINTS.get(self._monitor.word(MODE), '')

    def follow(self, q: JointPositions) -> None:
        """Keep the handle at the tip, unless it is dragged."""
        if self._handle.visible and not self._is_dragged:
            x, R = self._model.tip(q)
            self._handle.position = x
            self._handle.wxyz = np.roll(to_quaternion(R), 1)

    def _jog(self, dx: Twist, now: Seconds) -> None:
        if dx.any():
            self._asked_at = self._asked_at or now
            if now - self._moved_at >= _LAST_ZEROS:
                self._must_stop = True  # else it pulls the tip back to its path
            self._moved_at = now
            if self._twist_publisher is None:
                self._twist_publisher = self._monitor.create_publisher(
                    TwistStamped, 'cartesian_velocity', PUBLISH
                )
        else:
            self._asked_at = 0.0
        if self._twist_publisher and now - self._moved_at < _LAST_ZEROS:
            self._twist_publisher.publish(to_twist(_NOW, '', dx))

    # In viser's own loop, which keeps the phases in their order.
    async def _on_drag(self, event: Any) -> None:
        if event.phase == _END or not self._is_held():
            self._end_drag()
            return
        if event.phase == 'start' and not self._target_publisher.get_subscription_count():
            notify(event, 'no planner listens to target_pose; start one, to drag the tip')
            return
        self._is_dragged = True
        R = from_quaternion(np.roll(self._handle.wxyz, -1))
        self._target_publisher.publish(to_pose(_NOW, '', np.array(self._handle.position), R))

    def _end_drag(self) -> None:
        self._must_stop |= self._is_dragged
        self._is_dragged = False

    def _push_callback(self, link: str) -> Callable[[Any], Any]:
        async def on_drag(event: Any) -> None:
            self._push_event = event
            force = np.zeros(3)
            if event.phase != _END and self._is_held():
                force = _pull(event.start_position, event.end_position, self._largest.value)
            self._push = (link, force)

        return on_drag

    def _is_held(self) -> bool:
        return self._channel.direction(time.monotonic()) is not None

    def _next_order(self) -> Future[None] | None:
        """Begin the next call of a service; of several forces the newest counts."""
        if self._must_stop:
            self._must_stop = False
            return self._orders.submit(self._stop_planner)
        link, force = self._push
        if np.array_equal(force, self._pushed):
            return None
        return self._orders.submit(self._push_link, link, force)

    def _stop_planner(self) -> None:
        with suppress(CallError):  # there may be no planner
            self._bindings.client.trigger('planner/stop')

    def _push_link(self, link: str, force: np.ndarray) -> None:
        values = {'push_link': link, 'push_force': force.tolist()}
        self._pushed = force
        try:
            self._bindings.client.set_parameters('sim', values)
        except CallError as error:
            if self._push_event is not None:
                notify(self._push_event, str(error))

    def _add_inputs(self, gui: viser.GuiApi) -> None:
        has_sim = bool(self._bindings.values['sim'])
        with gui.add_folder('move by hand'):
            mouse = gui.add_dropdown('the mouse', (_VIEW, _DRAG, *((_PUSH,) if has_sim else ())))
            self._speed = gui.add_slider('speed [m/s]', 0.005, _SPEED[1], 0.005, _SPEED[0])
            self._turn = gui.add_slider('turning [rad/s]', 0.05, _TURN[1], 0.05, _TURN[0])
            self._turn.visible = self._rows == 6
            self._largest = gui.add_slider('largest push [N]', 0.0, _FORCE[1], 5.0, _FORCE[0])
            self._largest.visible = has_sim
            led: Any = gui.add_checkbox(
                'lead by hand',
                self._bindings.values['controller'][_ENABLED],
                hint='admittance: the tip yields to the measured wrench (5 kg, 30 N s/m)',
            )
        mouse.on_update(self._on_mouse)
        led.on_update(self._on_led)
        self._bindings.on_change('controller', _ENABLED, lambda value: setattr(led, 'value', value))

    def _on_mouse(self, event: Any) -> None:
        self._handle.visible = event.target.value == _DRAG
        for link, mesh in self._scene.meshes:
            mesh.remove_drag_callback()
            if event.target.value == _PUSH:
                mesh.on_drag('left')(self._push_callback(link))

    def _on_led(self, event: Any) -> None:
        """Have the tip yield to a hand, or no longer."""
        values: dict[str, Any] = {_ENABLED: event.target.value}
        if event.target.value:
            for name, (linear, angular) in _LED.items():
                values[f'admittance.{name}'] = [linear] * 3 + [angular] * (self._rows - 3)
        self._bindings.set(event, 'controller', values)


def _pull(taken: Any, mouse: Any, largest: float) -> np.ndarray:
    """The force of a spring between two points (3,) [m], not larger than allowed, (3,) [N]."""
    force = _SPRING * (np.array(mouse) - np.array(taken))
    size = float(np.linalg.norm(force))
    return force * min(1.0, largest / size) if size > 0.0 else force
