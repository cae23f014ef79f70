"""Buttons, menus and sliders: each sets a parameter or calls a service, and shows its state."""

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import viser

from redres_ros.graph.client import CallError, GraphClient
from redres_ros.laws import LAWS
from redres_ros.limits import LIMITS
from redres_ros.loop.velocity_input import AUTO
from redres_ros.nodes.parameters import NONE, named
from redres_ros.policy import SCALING
from redres_ros.preferences import PREFERENCES

_NOTICE = 8.0  # [s] for which a response is shown
_MOST_DAMPING = 50.0  # [1/s] on the slider; a node may have more


class Bindings:
    """Binds inputs of the page to the nodes; `values` are their parameters, by node and name."""

    def __init__(self, client: GraphClient, values: Mapping[str, Mapping[str, Any]]) -> None:
        self.client = client
        self.values = {node: dict(has) for node, has in values.items()}
        self._shows: dict[tuple[str, str], list[Callable[[Any], None]]] = {}

    def add(self, handle: Any, node: str, parameter: str) -> None:
        """Have an input set a parameter, and show what others set."""
        self.on_change(node, parameter, lambda value: setattr(handle, 'value', value))
        handle.on_update(lambda event: self.set(event, node, {parameter: event.target.value}))

    def on_change(self, node: str, parameter: str, show: Callable[[Any], None]) -> None:
        """Have something called with each new value of a parameter."""
        self._shows.setdefault((node, parameter), []).append(show)

    def show(self, node: str, values: Mapping[str, Any]) -> None:
        """Show what a node has now, no matter who set it.

        Values of other names and types are skipped: any participant can publish changes.
        """
        known = self.values.get(node, {})
        for name, value in values.items():
            if name in known and type(value) is type(known[name]):
                known[name] = value
                for show in self._shows.get((node, name), ()):
                    show(value)

    def set(self, event: Any, node: str, values: Mapping[str, Any]) -> None:
        """Set parameters; what is refused is shown as the node has it."""
        if event.client is None:  # shown by us, because the node has it already
            return
        known = {name: self.values[node][name] for name in values if name in self.values[node]}
        try:
            self.client.set_parameters(node, values)
        except CallError as error:
            _refuse(event, error)
            self.show(node, known)

    def trigger(self, event: Any, service: str, data: bool | None = None) -> None:
        """Call a service, and show its message to the browser that asked for it."""
        try:
            message = self.client.trigger(service, data)
        except CallError as error:
            _refuse(event, error)
        else:
            event.client.add_notification('Done', message, auto_close_seconds=_NOTICE)


def _refuse(event: Any, error: CallError) -> None:
    event.client.add_notification('Refused', str(error), color='red', auto_close_seconds=_NOTICE)


def add_controls(gui: viser.GuiApi, bindings: Bindings) -> None:
    """Add what starts the task, and what sets the law and its limits."""
    task = gui.add_button_group('task', ('start', 'home', 'stop'))
    _act_in_order(task, lambda event, name: bindings.trigger(event, f'planner/{name}'))
    arm = gui.add_button_group('arm', ('hold', 'resume'))
    _act_in_order(
        arm, lambda event, name: bindings.trigger(event, 'controller/hold', name == 'hold')
    )
    if bindings.values.get('sim'):
        reset = gui.add_button('reset the robot', color='red')
        reset.on_click(lambda event: bindings.trigger(event, 'sim/reset'))
    values = bindings.values['controller']
    most = max(_MOST_DAMPING, values['damping'])
    inputs: dict[str, Any] = {
        'law': gui.add_dropdown('law', tuple(LAWS), initial_value=values['law']),
        'damping': gui.add_slider('damping [1/s]', 0.0, most, 0.5, values['damping']),
        'limit_scale': gui.add_slider('limit scale', 0.05, 1.0, 0.05, values['limit_scale']),
        'scaling': gui.add_dropdown(
            'task scaling', (AUTO, *SCALING), initial_value=values['scaling']
        ),
    }
    for parameter, handle in inputs.items():
        bindings.add(handle, 'controller', parameter)
    _add_names(gui, bindings, 'limits', LIMITS)
    _add_names(gui, bindings, 'preferences', PREFERENCES)


def _act_in_order(buttons: Any, act: Callable[[Any, str], None]) -> None:
    """Have a group's buttons act one after the other, in the order in which they were clicked.

    viser calls a function in whichever thread is free, where the group may have another value.
    """
    in_order = ThreadPoolExecutor(1)

    async def _take(event: Any) -> None:
        in_order.submit(act, event, event.target.value)

    buttons.on_click(_take)


def _add_names(
    gui: viser.GuiApi, bindings: Bindings, parameter: str, table: Mapping[str, type]
) -> None:
    """A box to tick for each entry of a table that a parameter of the controller may name."""
    ticked = named(bindings.values['controller'][parameter])
    with gui.add_folder(parameter, expand_by_default=parameter == 'limits'):
        boxes: dict[str, Any] = {name: gui.add_checkbox(name, name in ticked) for name in table}

    def _order(event: Any) -> None:
        names = [name for name, box in boxes.items() if box.value] or [NONE]
        bindings.set(event, 'controller', {parameter: names})

    def _show(names: Any) -> None:
        for name, box in boxes.items():
            box.value = name in names

    for box in boxes.values():
        box.on_update(_order)
    bindings.on_change('controller', parameter, _show)
