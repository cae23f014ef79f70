"""What the mouse does to the arm: drags the tip, or pushes a link of the fake robot."""

from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from redres_ros.graph.graph_monitor import GraphMonitor
from redres_ros.graph.teleop import TargetPublisher
from redres_ros.robot_model import RobotModel
from redres_ros.rotation import from_quaternion, to_quaternion
from redres_ros.view.controls import notify
from redres_ros.view.scene import ArmScene

_SIZE = 0.25  # of the handle, for an arm that reaches 1 m
_SPRING = 300.0  # [N/m] from the point that was taken to the mouse
_START = 'start'  # phases of a drag
_END = 'end'


class TipHandle:
    """A handle at the tip: while it is dragged, its pose is streamed on `target_pose`.

    Args:
        server: Server of the page.
        monitor: Publishes.
        model: The arm.
        turns: Whether the orientation is part of the task.
        is_allowed: Whether the dead-man switch is held.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        monitor: GraphMonitor,
        model: RobotModel,
        turns: bool,
        is_allowed: Callable[[], bool],
    ) -> None:
        self.is_dragged = False
        self._model = model
        self._is_allowed = is_allowed
        self._publisher = TargetPublisher(monitor)
        self._handle = server.scene.add_transform_controls(
            '/tip_handle',
            scale=_SIZE * model.reach,
            disable_rotations=not turns,
            depth_test=False,
            visible=False,
        )
        self._handle.on_update(self._on_update)

    def set_visible(self, visible: bool) -> None:
        """Show or hide it."""
        self._handle.visible = visible

    def follow(self, q: np.ndarray) -> None:
        """Keep it at the tip of the arm at q (n,) [rad], unless it is dragged."""
        if self._handle.visible and not self.is_dragged:
            x, R = self._model.tip(q)
            qx, qy, qz, qw = to_quaternion(R)
            self._handle.position = x
            self._handle.wxyz = np.array((qw, qx, qy, qz))

    # Of viser's own loop, which keeps the phases in their order.
    async def _on_update(self, event: Any) -> None:
        if event.phase == _END or not self._is_allowed():
            self.is_dragged = False
            return
        if event.phase == _START and not self._publisher.listeners:
            notify(event, 'no planner listens to target_pose; start one, to drag the tip')
            return
        self.is_dragged = True
        w, x, y, z = self._handle.wxyz
        R = from_quaternion(np.array((x, y, z, w)))
        self._publisher.publish(np.array(self._handle.position), R)


class LinkPush:
    """Links that can be taken with the mouse, which pulls at them like a spring.

    Args:
        scene: Scene with the links.
        is_allowed: Whether the dead-man switch is held.
    """

    def __init__(self, scene: ArmScene, is_allowed: Callable[[], bool]) -> None:
        self.largest = 0.0  # [N]
        self.force = np.zeros(3)  # in the frame of the base [N]
        self.link = ''  # that it acts on; empty: the tip
        self.event: Any = None  # the last one, which says who pushes
        self._scene = scene
        self._is_allowed = is_allowed

    def set_active(self, active: bool) -> None:
        """Let the links be taken, or not."""
        for link, mesh in self._scene.meshes:
            mesh.remove_drag_callback()
            if active:
                mesh.on_drag('left')(self._callback(link))

    def _callback(self, link: str) -> Any:
        async def on_drag(event: Any) -> None:
            self.event = event
            if event.phase == _END or not self._is_allowed():
                self.force = np.zeros(3)
                return
            self.link = link
            self.force = pull(event.start_position, event.end_position, self.largest)

        return on_drag


def pull(taken: Any, mouse: Any, largest: float) -> np.ndarray:
    """The force of a spring, (3,) [N].

    Args:
        taken: Where the link was taken, (3,) [m].
        mouse: Where the mouse is, (3,) [m].
        largest: Allowed [N].
    """
    force = _SPRING * (np.array(mouse) - np.array(taken))
    size = float(np.linalg.norm(force))
    return force * min(1.0, largest / size) if size > 0.0 else force
