"""Buttons, menus and sliders: each controls one parameter or service, and shows its state."""

from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any, NamedTuple

import viser

from redres_ros.fake_robot.faults import Faults
from redres_ros.laws import LAWS
from redres_ros.limits import LIMITS
from redres_ros.loop.settings import AUTO
from redres_ros.nodes.parameters import NONE
from redres_ros.nodes.policy_parameters import named
from redres_ros.policy import SCALING
from redres_ros.preferences import PREFERENCES
from redres_ros.view.bindings import Bindings

Orders = Mapping[str, Callable[[], str]]  # by the label of a button

_MOST_DAMPING = 50.0  # [1/s] on the slider; a node may have more


class _Slider(NamedTuple):
    """A fault of the fake robot as a slider: parameter, label, largest value and step."""

    parameter: str
    label: str
    most: float
    step: float


_FAULTS = (
    _Slider('command_loss', 'commands lost [0 to 1]', 0.3, 0.01),
    _Slider('state_loss', 'states lost [0 to 1]', 0.3, 0.01),
    _Slider('command_delay', 'commands late [cycles]', 10, 1),
    _Slider('state_delay', 'states late [cycles]', 10, 1),
    _Slider('encoder_noise', 'encoder noise [rad]', 0.001, 0.0001),
    _Slider('frozen_joint', 'frozen encoder [joint; 0: none]', 7, 1),
)


def add_controls(gui: viser.GuiApi, bindings: Bindings) -> None:
    """Add what starts the task, and what sets the law and its limits.

    Args:
        gui: Of the page.
        bindings: To the nodes.
    """
    values = bindings.values['controller']
    _add_task(gui, bindings)
    _add_law(gui, bindings, values)
    _add_names(gui, bindings, 'limits', LIMITS)
    _add_names(gui, bindings, 'preferences', PREFERENCES)


def add_faults(gui: viser.GuiApi, bindings: Bindings) -> None:
    """Add the faults of the fake robot.

    Args:
        gui: Of the page.
        bindings: To the nodes.
    """
    values = bindings.values['sim']
    with gui.add_folder('faults of the fake robot', expand_by_default=False):
        for fault in _FAULTS:
            kind = type(values[fault.parameter])
            most = kind(fault.most)
            slider = gui.add_slider(
                fault.label,
                kind(0),
                most,
                kind(fault.step),
                initial_value=min(values[fault.parameter], most),
            )
            bindings.add(slider, 'sim', fault.parameter)
        paused = gui.add_checkbox('joints do not move', values['paused_physics'])
        bindings.add(paused, 'sim', 'paused_physics')
        well = gui.add_button('no faults')
    none = {field.name: field.default for field in fields(Faults)}
    well.on_click(lambda event: bindings.set(event, 'sim', none))


def _add_task(gui: viser.GuiApi, bindings: Bindings) -> None:
    client = bindings.client
    task: Orders = {
        'start': lambda: client.trigger('planner/start'),
        'home': lambda: client.trigger('planner/home'),
        'stop': lambda: client.trigger('planner/stop'),
    }
    arm: Orders = {'hold': lambda: client.hold(True), 'resume': lambda: client.hold(False)}
    _add_orders(gui, bindings, 'task', task)
    _add_orders(gui, bindings, 'arm', arm)
    if bindings.values.get('sim'):
        reset = gui.add_button('reset the robot', color='red')
        reset.on_click(lambda event: bindings.order(event, lambda: client.trigger('sim/reset')))


def _add_orders(gui: viser.GuiApi, bindings: Bindings, label: str, orders: Orders) -> None:
    buttons = gui.add_button_group(label, tuple(orders))
    buttons.on_click(lambda event: bindings.order(event, orders[event.target.value]))


def _add_law(gui: viser.GuiApi, bindings: Bindings, values: Mapping[str, Any]) -> None:
    law = gui.add_dropdown('law', tuple(LAWS), initial_value=values['law'])
    bindings.add(law, 'controller', 'law')
    most = max(_MOST_DAMPING, values['damping'])
    damping = gui.add_slider('damping [1/s]', 0.0, most, 0.5, initial_value=values['damping'])
    bindings.add(damping, 'controller', 'damping')
    scale = gui.add_slider('limit scale', 0.05, 1.0, 0.05, initial_value=values['limit_scale'])
    bindings.add(scale, 'controller', 'limit_scale')
    scaling = gui.add_dropdown('task scaling', (AUTO, *SCALING), initial_value=values['scaling'])
    bindings.add(scaling, 'controller', 'scaling')


def _add_names(
    gui: viser.GuiApi, bindings: Bindings, parameter: str, table: Mapping[str, type]
) -> None:
    """A box to tick for each entry of a table that a parameter of the controller may name."""
    ticked = named(bindings.values['controller'][parameter])
    with gui.add_folder(parameter, expand_by_default=parameter == 'limits'):
        boxes = {name: gui.add_checkbox(name, name in ticked) for name in table}
    bindings.add_names(boxes, 'controller', parameter, NONE)
