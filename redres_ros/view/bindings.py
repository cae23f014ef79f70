"""The one way from an element of the page to the nodes, and back."""

from collections.abc import Callable, Mapping
from typing import Any

import viser

from redres_ros.graph.client import CallError, GraphClient
from redres_ros.graph.settings import credible

Show = Callable[[Any], None]

_NOTICE = 8.0  # [s] for which a refusal is shown


class Bindings:
    """Binds elements of the page to parameters and services of the nodes.

    Args:
        client: Gives the orders.
        values: The parameters of the nodes at present, by node and name.
    """

    def __init__(self, client: GraphClient, values: Mapping[str, Mapping[str, Any]]) -> None:
        self.client = client
        self.values = {node: dict(has) for node, has in values.items()}
        self._shows: dict[tuple[str, str], list[Show]] = {}

    def add(self, handle: Any, node: str, parameter: str) -> None:
        """Have an input set a parameter, and show what others set.

        Args:
            handle: Of the input.
            node: Name of the node that has the parameter.
            parameter: Its name.
        """

        def show(value: Any) -> None:
            handle.value = value

        self.on_change(node, parameter, show)
        handle.on_update(lambda event: self.set(event, node, {parameter: event.target.value}))

    def add_names(self, boxes: Mapping[str, Any], node: str, parameter: str, none: str) -> None:
        """Have boxes to tick set a parameter that lists names, and show what others set.

        Args:
            boxes: By the names.
            node: Name of the node that has the parameter.
            parameter: Its name.
            none: What the parameter holds in place of an empty list.
        """

        def order(event: viser.GuiEvent[Any]) -> None:
            names = [name for name, box in boxes.items() if box.value] or [none]
            self.set(event, node, {parameter: names})

        def show(names: Any) -> None:
            for name, box in boxes.items():
                box.value = name in names

        for box in boxes.values():
            box.on_update(order)
        self.on_change(node, parameter, show)

    def on_change(self, node: str, parameter: str, show: Show) -> None:
        """Have something called with each new value of a parameter.

        Args:
            node: Name of the node that has it.
            parameter: Its name.
            show: Is called.
        """
        self._shows.setdefault((node, parameter), []).append(show)

    def show(self, node: str, values: Mapping[str, Any]) -> None:
        """Show what a node has now, no matter who set it; impossible values are skipped.

        Args:
            node: Its name.
            values: Of its parameters, by their names.
        """
        for name, value in credible(values, self.values.get(node, {})).items():
            self.values[node][name] = value
            for show in self._shows.get((node, name), ()):
                show(value)

    def set(self, event: Any, node: str, values: Mapping[str, Any]) -> None:
        """Set parameters; what is refused is shown as the node has it.

        Args:
            event: What was changed, and by whom.
            node: Name of the node.
            values: By the names of the parameters.
        """
        known = {name: self.values[node][name] for name in values if name in self.values[node]}
        self.order(
            event,
            lambda: self.client.set_parameters(node, values),
            lambda: self.show(node, known),
        )

    def order(
        self,
        event: Any,
        order: Callable[[], str | None],
        undo: Callable[[], None] = lambda: None,
    ) -> None:
        """Carry out an order at the page; the response of the nodes is shown to its browser
        alone.

        Args:
            event: What was clicked, and by whom.
            order: Asks the nodes; gives their response in words, if there is one.
            undo: Is called if they refuse.
        """
        if event.client is None:  # shown by us, because a node has it already
            return
        try:
            response = order()
        except CallError as error:
            notify(event, str(error))
            undo()
            return
        if response:
            event.client.add_notification('Done', response, auto_close_seconds=5)


def notify(event: Any, text: str) -> None:
    """Show a refusal to somebody at the page.

    Args:
        event: Of whom.
        text: What is refused, and why.
    """
    if event.client is not None:
        event.client.add_notification('Refused', text, color='red', auto_close_seconds=_NOTICE)
