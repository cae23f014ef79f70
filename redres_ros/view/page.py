"""The live page as a node: `redres view` beside any graph, and `redres demo --view`."""

import os
import sys
import threading
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import viser
from std_msgs.msg import Float64, String

from redres_ros.files.plugins import load_plugin
from redres_ros.graph.monitor import WORDS, GraphMonitor, LiveArm
from redres_ros.nodes.controller_telemetry import PERIOD, Figures
from redres_ros.nodes.parameters import NONE, declare, named
from redres_ros.nodes.runtime import Spinner, run_nodes
from redres_ros.nodes.topics import ACTIVE_LIMITS, PROGRESS
from redres_ros.parameter import param
from redres_ros.planning.waypoints import task_for
from redres_ros.robots.scene import shapes_of, touched
from redres_ros.view.controls import Bindings, add_controls
from redres_ros.view.panel import Plots, joint_bars, state_text
from redres_ros.view.scene import ArmScene
from redres_ros.view.server import ADDRESS, open_server
from redres_ros.view.teleoperation import Teleoperation

_NICENESS = 10  # with few processors, observers must wait for the nodes
_PERIOD = 0.05  # [s] from one picture of the arm to the next
_SLOWLY = 6  # pictures from one drawing of plots, paths and words to the next
_PLOTTED = 15  # [s]
_TRACED = 20  # [s]
_SNAPSHOTS = 1_000_000_000 // PERIOD  # in a second
_WALLS = ('limits', 'scene.')  # parameters of what is drawn


class _Page:
    """A page of one graph, on an empty server. Raises RedresError for an unknown arm or task."""

    def __init__(
        self,
        server: viser.ViserServer,
        monitor: GraphMonitor,
        values: Mapping[str, Mapping[str, Any]],
    ) -> None:
        self._server = server
        self._monitor = monitor
        self._arm = LiveArm(monitor, values['controller'])
        model = self._arm.model
        planner = monitor.client.parameters('planner', ('task', 'robot'))
        task = task_for(model.arm, planner['robot'], planner['task'])
        self._scene = ArmScene(server, model, task.waypoints)
        self._bindings = Bindings(monitor.client, values)
        self._add_panel()
        add_controls(server.gui, self._bindings)
        server.gui.main_panel.dock_right()
        self._show_walls()
        self._figures: deque[Figures] = deque(maxlen=_PLOTTED * _SNAPSHOTS)
        self._paths: dict[str, deque[np.ndarray]] = {
            name: deque(maxlen=_TRACED * _SNAPSHOTS) for name in self._scene.traced(self._arm.q)
        }
        monitor.on_parameters = self._on_parameters

    def run(self, stopped: threading.Event) -> None:
        """Keep the page up to date until the event is set."""
        number = 0
        while not stopped.wait(_PERIOD):
            if not self._server.get_clients():
                self._clear()  # nobody watches: leave a gap in the curves
                continue
            self._look()
            number += 1
            with self._server.atomic():
                self._scene.show(self._arm.q)
                if number % _SLOWLY == 0:
                    self._show_slowly()

    def _add_panel(self) -> None:
        gui = self._server.gui
        seen = gui.add_panel()
        with seen.add_tab('state'):
            self._state = gui.add_html('')
            with gui.add_folder('joint positions, active limits'):
                self._bars = gui.add_html('')
            with gui.add_folder(f'the last {_PLOTTED} seconds'):
                self._plots = Plots(gui)
        seen.dock_left()

    def _look(self) -> None:
        figures = self._arm.look()
        if not figures:
            return
        if self._figures and figures[0]['time'] < self._figures[-1]['time']:
            self._clear()  # the robot has another clock
        self._figures.extend(figures)
        for name, place in self._scene.traced(self._arm.q).items():
            self._paths[name].append(place)

    def _clear(self) -> None:
        self._figures.clear()
        for path in self._paths.values():
            path.clear()

    def _show_slowly(self) -> None:
        newest = {topic: self._monitor.word(topic) for topic in WORDS}
        progress = self._monitor.sampled(PROGRESS, Float64, 0.0)
        self._state.content = state_text(newest, self._monitor.health(), progress)
        limited = self._monitor.sampled(ACTIVE_LIMITS, String, '')
        self._bars.content = joint_bars(self._arm.model, self._arm.q, limited)
        for name, path in self._paths.items():
            self._scene.trace(name, np.array(path))
        if len(self._figures) > 1:
            self._plots.show(self._figures)

    def _show_walls(self) -> None:
        values = self._bindings.values
        walls = list(shapes_of(values['controller'].__getitem__))
        if values['sim']:
            walls += touched(values['sim'].__getitem__)
        self._scene.show_walls(walls)

    def _on_parameters(self, node: str, values: dict[str, Any]) -> None:
        """Show parameters that were changed, by this page or elsewhere."""
        self._bindings.show(node, values)
        if node == 'controller' and any(name.startswith(_WALLS) for name in values):
            self._show_walls()


@dataclass(frozen=True)
class _ViewParameters:
    port: int = param(8080, 'of the page; the next free one is taken', 1024, 65535)
    plugins: tuple[str, ...] = param(
        (NONE,), 'Python files with the laws, preferences and limits that the controller has'
    )
    patience: float = param(10.0, 'how long a graph may take to appear [s]', 0.0, 600.0)


class _ViewNode(GraphMonitor):
    """Serves a page of the graph in its domain and namespace."""

    def __init__(self) -> None:
        super().__init__('view')
        self._settings = declare(self, _ViewParameters())
        # Those of this node's own starter: what a graph names is not executed here.
        for plugin in named(self._settings.plugins):
            load_plugin(plugin)

    def run(self, stopped: threading.Event, spinner: Spinner) -> None:
        """Wait for the graph, and serve the page until the event is set.

        Raises CallError if no graph has appeared, and OriginError if others could load the page.
        """
        with spinner.in_thread():
            if self.client.await_nodes(stopped, self._settings.patience):
                self._serve(stopped)

    def _serve(self, stopped: threading.Event) -> None:
        values = {
            'controller': self.client.parameters('controller'),
            # None beside a real robot.
            'sim': self.client.parameters('sim') if self.client.offers('sim') else {},
        }
        rows = 6 if values['controller']['task_space'] == 'pose' else 3
        teleoperation = Teleoperation(self, rows)
        server = open_server(self._settings.port, 'redres', teleoperation.serve)
        try:
            page = _Page(server, self, values)
            teleoperation.start(server.gui)
            print(f'page: http://{ADDRESS}:{server.get_port()}', flush=True)
            page.run(stopped)
        finally:
            server.stop()


def main(arguments: list[str] | None = None, domain: int | None = None) -> int:
    os.nice(_NICENESS)
    return run_nodes(_ViewNode, arguments=arguments, domain=domain)


if __name__ == '__main__':
    sys.exit(main())
