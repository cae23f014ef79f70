"""Steers the arm while the dead-man switch of the page is held: by jogging, or by the mouse."""

import threading
import time
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from typing import Any

import numpy as np
import viser

from redres_ros.graph.client import CallError
from redres_ros.graph.graph_monitor import GraphMonitor
from redres_ros.graph.teleop import TwistPublisher
from redres_ros.nodes.topics import MODE, REASON
from redres_ros.robot_model import RobotModel
from redres_ros.view.controls import Bindings, notify
from redres_ros.view.dead_man import DeadMan
from redres_ros.view.mouse import LinkPush, TipHandle
from redres_ros.view.scene import ArmScene

_PERIOD = 0.02  # [s] between task velocities
_PATIENCE = 0.5  # [s] in which the arm begins to move
_AXES = ('x', 'y', 'z')
_VIEW = 'turns the view'
_DRAG = 'drags the tip'
_PUSH = 'pushes a link'
_MOUSE = (_VIEW, _DRAG, _PUSH)
_FORCE = 40.0  # [N] at first
_MOST_FORCE = 200.0  # [N]
_SPEED = (0.05, 0.5)  # [m/s] at first, and at most
_TURN = (0.3, 2.0)  # [rad/s]
_PUSH_TIME = 0.4  # [s] of a push by a button
_RENEWED = (0.5, 2.0)  # [s] when a push of the mouse is set again, and when it ends without that
_LED = {'mass': (5.0, 0.05), 'damping': (30.0, 1.0), 'stiffness': (0.0, 0.0), 'force': (0.0, 0.0)}
_HINTS = {
    'inactive': 'the controller is inactive; activate it first',
    'mirroring': 'the robot takes no commands at present',
    'holding': 'the controller holds: "resume" lets it go on',
}


class Teleoperation:
    """What an operator does to the arm by hand.

    Args:
        server: Of the page.
        monitor: Publishes, and knows what the nodes report.
        bindings: To the nodes.
        scene: Has the arm.
        model: The arm.
        dead_man: The switch.
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
        self._turns = bindings.values['controller']['task_space'] == 'pose'
        self._has_sim = bool(bindings.values['sim'])
        self._twists: TwistPublisher | None = None  # made for the first motion
        self._asked_at = 0.0  # [s] since when a velocity is asked for; 0: none is
        self._was_dragged = False
        self._pushed = np.zeros(3)  # sent to the robot last [N]
        self._pushed_at = 0.0  # [s]
        self._orders = ThreadPoolExecutor(max_workers=1)
        self._order: Future[Any] | None = None  # under way
        self._tip = TipHandle(server, monitor, model, self._turns, self._is_held)
        self._link = LinkPush(scene, self._is_held)
        self._add_inputs(server.gui)
        if self._has_sim:
            self._add_push(server.gui, model.links)

    @property
    def rows(self) -> int:
        """Rows of a task velocity, 3 or 6."""
        return 6 if self._turns else 3

    def run(self, stopped: threading.Event) -> None:
        """Steer until the event is set, and leave nothing behind."""
        while not stopped.wait(_PERIOD):
            self.step(time.monotonic())
        if self._twists is not None:
            self._twists.stop()
        self._orders.shutdown()
        if self._pushed.any():
            with suppress(CallError):
                self._set_force(np.zeros(3), self._link.link)

    def step(self, now: float) -> None:
        """Publish what is asked for at a time [s]."""
        direction = self._dead_man.direction(now)
        if direction.any():
            self._asked_at = self._asked_at or now
            self._twists = self._twists or TwistPublisher(self._monitor)
        else:
            self._asked_at = 0.0
        if self._twists is not None:
            speeds = np.repeat((self._speed.value, self._turn.value), 3)
            self._twists.publish(direction * speeds, now)
        if not self._dead_man.is_held(now):
            self._tip.is_dragged = False
            self._link.force = np.zeros(3)
        if self._order is None or self._order.done():
            self._order = self._next_order()

    def status(self) -> str:
        """Why the arm does not move although it is asked to; empty if nothing is known."""
        if not self._asked_at or time.monotonic() - self._asked_at < _PATIENCE:
            return ''
        if self._twists is not None and not self._twists.listeners:
            return 'no controller listens to cartesian_velocity'
        reason = self._monitor.word(REASON)
        if reason:
            return f'the robot has stopped: {reason}; "reset the robot" lets it go on'
        return _HINTS.get(self._monitor.word(MODE), '')

    def follow(self, q: np.ndarray) -> None:
        """Keep the handle at the tip of the arm at q (n,) [rad]."""
        self._tip.follow(q)

    def _is_held(self) -> bool:
        return self._dead_man.is_held(time.monotonic())

    def _next_order(self) -> Future[Any] | None:
        """Begin the next call of a service; of several forces the newest counts."""
        if self._was_dragged != self._tip.is_dragged:
            self._was_dragged = self._tip.is_dragged
            if not self._was_dragged:
                return self._orders.submit(self._stop_task)
        force = self._link.force
        is_fresh = not force.any() or time.monotonic() - self._pushed_at < _RENEWED[0]
        if is_fresh and np.array_equal(force, self._pushed):
            return None
        return self._orders.submit(self._push_link, force, self._link.link)

    def _stop_task(self) -> None:
        with suppress(CallError):  # a planner that has gone leads nothing on
            self._bindings.client.trigger('planner/stop')

    def _push_link(self, force: np.ndarray, link: str) -> None:
        try:
            self._set_force(force, link)
        except CallError as error:
            self._link.force = self._pushed
            notify(self._link.event, str(error))
        else:
            self._pushed = force
            self._pushed_at = time.monotonic()

    def _set_force(self, force: np.ndarray, link: str) -> None:
        values = {f'push_force_{axis}': f for axis, f in zip(_AXES, force.tolist(), strict=True)}
        values['push_time'] = _RENEWED[1] if force.any() else 0.0
        self._bindings.client.set_parameters('sim', {'push_link': link, **values})

    def _add_inputs(self, gui: viser.GuiApi) -> None:
        with gui.add_folder('move by hand'):
            mouse = _MOUSE if self._has_sim else _MOUSE[:2]
            self._mouse = gui.add_dropdown('the mouse', mouse, initial_value=_VIEW)
            self._speed = gui.add_slider('speed [m/s]', 0.005, _SPEED[1], 0.005, _SPEED[0])
            self._turn = gui.add_slider('turning [rad/s]', 0.05, _TURN[1], 0.05, _TURN[0])
            self._turn.visible = self._turns
            led: Any = gui.add_checkbox(
                'lead by hand',
                self._bindings.values['controller']['admittance.enabled'],
                hint='admittance: the tip yields to the measured wrench (5 kg, 30 N s/m)',
            )
        self._mouse.on_update(self._on_mouse)
        led.on_update(self._on_led)

        def show(enabled: Any) -> None:
            led.value = enabled

        self._bindings.on_change('controller', 'admittance.enabled', show)

    def _on_mouse(self, event: Any) -> None:
        self._tip.set_visible(event.target.value == _DRAG)
        self._link.set_active(event.target.value == _PUSH)

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
        self._link.largest = _FORCE
        force.on_update(lambda event: setattr(self._link, 'largest', event.target.value))
        buttons.on_click(lambda event: self._push(event, event.target.value, force.value))

    def _push(self, event: Any, axis: str, force: float) -> None:
        """Push for a moment."""
        push = {f'push_force_{axis}': force, 'push_time': _PUSH_TIME}
        self._bindings.set(event, 'sim', push)
