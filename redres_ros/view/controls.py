"""Buttons, menus and sliders: each controls one parameter or service, and shows its state."""

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from typing import Any, NamedTuple

import viser

from redres_ros.fake_robot.faults import Faults
from redres_ros.graph.client import CallError, GraphClient
from redres_ros.graph.settings import credible
from redres_ros.laws import LAWS
from redres_ros.limits import LIMITS
from redres_ros.loop.settings import AUTO
from redres_ros.nodes.parameters import NONE
from redres_ros.nodes.policy_parameters import named
from redres_ros.policy import SCALING
from redres_ros.preferences import PREFERENCES

_MOST_DAMPING = 50.0  # [1/s] on the slider; a node may have more
_DIRECTIONS = ('x', 'y', 'z')
_PUSH = 60.0  # [N] at first
_PUSH_MOST = 200.0  # [N]
_PUSH_TIME = 0.4  # [s]


class _Slider(NamedTuple):
    """A fault of the fake robot as a slider: parameter, label, largest value and step."""

    parameter: str
    label: str
    most: float
    step: float


_FAULTS = (
    _Slider('command_loss', 'commands lost', 0.3, 0.01),
    _Slider('state_loss', 'states lost', 0.3, 0.01),
    _Slider('command_delay', 'commands late [cycles]', 10, 1),
    _Slider('state_delay', 'states late [cycles]', 10, 1),
    _Slider('encoder_noise', 'encoder noise [rad]', 0.001, 0.0001),
    _Slider('frozen_joint', 'joint whose encoder stands', 7, 1),
)


class Controls:
    """What can be steered.

    Args:
        server: Of the page.
        client: Gives the orders.
        values: The parameters of 'controller' and 'sim' at present.
        links: Of the arm, which can be pushed.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        client: GraphClient,
        values: Mapping[str, Mapping[str, Any]],
        links: Sequence[str] = (),
    ) -> None:
        self._server = server
        self._client = client
        self._values = {node: dict(has) for node, has in values.items()}
        self._shows: dict[str, dict[str, Callable[[Any], None]]] = {'controller': {}, 'sim': {}}
        self._add_task()
        self._add_law(values['controller'])
        self._add_names('limits', LIMITS, values['controller'])
        self._add_names('preferences', PREFERENCES, values['controller'])
        if values['sim']:
            self._add_push(values['sim']['push_link'], links)
            self._add_faults(values['sim'])

    def show(self, node: str, values: Mapping[str, Any]) -> None:
        """Show what a node has now, no matter who set it; impossible values are skipped.

        Args:
            node: Its name.
            values: Of its parameters, by their names.
        """
        for name, value in credible(values, self._values.get(node, {})).items():
            if name in self._shows[node]:
                self._values[node][name] = value
                self._shows[node][name](value)

    def _add_task(self) -> None:
        gui = self._server.gui
        buttons = gui.add_button_group('task', ('start', 'home', 'stop', 'hold', 'go on'))
        orders = {
            'start': lambda: self._client.trigger('planner/start'),
            'home': lambda: self._client.trigger('planner/home'),
            'stop': lambda: self._client.trigger('planner/stop'),
            'hold': lambda: self._client.hold(True),
            'go on': lambda: self._client.hold(False),
        }
        buttons.on_click(lambda event: self._give(event, orders[event.target.value]))
        reset = gui.add_button('reset the robot', color='red')
        reset.on_click(lambda event: self._give(event, lambda: self._client.trigger('sim/reset')))

    def _add_law(self, values: Mapping[str, Any]) -> None:
        gui = self._server.gui
        law = gui.add_dropdown('law', tuple(LAWS), initial_value=values['law'])
        self._bind(law, 'controller', 'law')
        most = max(_MOST_DAMPING, values['damping'])
        damping = gui.add_slider('damping [1/s]', 0.0, most, 0.5, initial_value=values['damping'])
        self._bind(damping, 'controller', 'damping')
        scale = gui.add_slider('limit scale', 0.05, 1.0, 0.05, initial_value=values['limit_scale'])
        self._bind(scale, 'controller', 'limit_scale')
        scaling = gui.add_dropdown(
            'limits scale', (AUTO, *SCALING), initial_value=values['scaling']
        )
        self._bind(scaling, 'controller', 'scaling')

    def _add_names(self, of: str, table: Mapping[str, type], values: Mapping[str, Any]) -> None:
        """A box to tick for each entry of a table that a parameter may name."""
        boxes: dict[str, Any] = {}
        with self._server.gui.add_folder(of, expand_by_default=of == 'limits'):
            for name in table:
                boxes[name] = self._server.gui.add_checkbox(name, name in named(values[of]))

        def order(event: viser.GuiEvent[Any]) -> None:
            names = [name for name, box in boxes.items() if box.value] or [NONE]
            self._set(event, 'controller', of, names)

        def show(names: Any) -> None:
            for name, box in boxes.items():
                box.value = name in names

        for box in boxes.values():
            box.on_update(order)
        self._shows['controller'][of] = show

    def _add_push(self, pushed: str, links: Sequence[str]) -> None:
        """What pushes a link.

        Args:
            pushed: The link at present; '' is the tip.
            links: Those that there are.
        """
        gui = self._server.gui
        with gui.add_folder('push the arm'):
            link = gui.add_dropdown('link (none: the tip)', ('', *links), initial_value=pushed)
            self._bind(link, 'sim', 'push_link')
            force = gui.add_slider('force [N]', 0.0, _PUSH_MOST, 5.0, initial_value=_PUSH)
            buttons = gui.add_button_group('along', _DIRECTIONS)
        buttons.on_click(lambda event: self._push(event, event.target.value, force.value))

    def _push(self, event: viser.GuiEvent[Any], direction: str, force: float) -> None:
        """Push for a moment."""
        parameter = f'push_force_{direction}'
        self._set(event, 'sim', parameter, force)
        threading.Timer(_PUSH_TIME, self._set, (event, 'sim', parameter, 0.0)).start()

    def _add_faults(self, values: Mapping[str, Any]) -> None:
        gui = self._server.gui
        with gui.add_folder('faults', expand_by_default=False):
            for fault in _FAULTS:
                kind = type(values[fault.parameter])
                slider = gui.add_slider(
                    fault.label,
                    kind(0),
                    kind(fault.most),
                    kind(fault.step),
                    initial_value=min(values[fault.parameter], kind(fault.most)),
                )
                self._bind(slider, 'sim', fault.parameter)
            paused = gui.add_checkbox('arm stands still', values['paused_physics'])
            self._bind(paused, 'sim', 'paused_physics')
            well = gui.add_button('all is well')
        none = {field.name: field.default for field in fields(Faults)}
        well.on_click(
            lambda event: self._give(event, lambda: self._client.set_parameters('sim', none))
        )

    def _bind(self, handle: Any, node: str, parameter: str) -> None:
        """Have an input set a parameter, and show what others set."""

        def show(value: Any) -> None:
            handle.value = value

        self._shows[node][parameter] = show
        handle.on_update(lambda event: self._set(event, node, parameter, event.target.value))

    def _set(self, event: viser.GuiEvent[Any], node: str, parameter: str, value: Any) -> None:
        """Set a parameter; one that is refused is shown as the node has it."""
        self._give(
            event,
            lambda: self._client.set_parameters(node, {parameter: value}),
            lambda: self.show(node, {parameter: self._values[node][parameter]}),
        )

    def _give(
        self,
        event: viser.GuiEvent[Any],
        order: Callable[[], str | None],
        undo: Callable[[], None] = lambda: None,
    ) -> None:
        """Carry out an order of somebody at the page; what the nodes answer is shown to its browser
        alone.

        Args:
            event: What was clicked, and by whom.
            order: Asks the nodes; gives their answer in words, if there is one.
            undo: Is called where they refuse.
        """
        if event.client is None:  # shown by us, because a node has it already
            return
        try:
            answer = order()
        except CallError as error:
            event.client.add_notification('Refused', str(error), color='red', auto_close_seconds=8)
            undo()
            return
        if answer:
            event.client.add_notification('Done', answer, auto_close_seconds=5)
