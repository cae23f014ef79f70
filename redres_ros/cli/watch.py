"""`redres watch`: the live state of running nodes, and their controller's parameters."""

import argparse
from typing import TYPE_CHECKING, Any

from redres_ros.cli.options import add_domain, add_namespace, add_watching_time
from redres_ros.cli.parser import OptionError, add_command, option
from redres_ros.errors import UnknownNameError

if TYPE_CHECKING:
    from redres_ros.graph.client import GraphClient

_PATIENCE = 20.0  # [s] for a controller on a busy machine to be found, and to respond


def add(commands: Any) -> None:
    """Declare the subcommand."""
    watch = add_command(
        commands,
        'watch',
        'the live state of running nodes; switches their law',
        '--domain 42',
        '--set law=minimum_velocity  # another law, and its effect',
        '--set limit_scale=0.5 --duration 0  # sets it, and ends',
        '--duration 10 > watch.txt  # not in a terminal: a line a second',
    )
    parameters = 'first set these parameters of the controller, all or none'
    option(watch, '--set', 'NAME=VALUE', parameters, nargs='+', action='extend')
    add_watching_time(watch)
    add_domain(watch)
    add_namespace(watch)
    watch.set_defaults(run=_watch)


def _watch(options: argparse.Namespace) -> int:
    from redres_ros.graph.client import GraphClient
    from redres_ros.graph.watch import Watch, watch
    from redres_ros.nodes.runtime import joined_domain, spun

    settings = options.set or []
    texts = _texts(settings)
    with joined_domain(options.domain), spun(lambda: Watch(options.namespace)) as node:
        if texts:
            client = GraphClient(node, _PATIENCE)
            client.set_parameters('controller', _values(client, texts))
            print(f'controller: {", ".join(settings)}', flush=True)
            if options.duration == 0.0:
                return 0
        watch(node, options.duration)
        return 0 if node.values else 1


def _texts(settings: list[str]) -> dict[str, str]:
    """The text of each value, by the name of its parameter. Raises OptionError."""
    texts = {}
    for setting in settings:
        name, _, text = setting.partition('=')
        if not (name and text):
            raise OptionError(f'--set {setting}; expected NAME=VALUE, such as law=minimum_velocity')
        texts[name] = text
    return texts


def _values(client: 'GraphClient', texts: dict[str, str]) -> dict[str, Any]:
    """Values of the types that the controller's parameters have, by name.

    Raises:
        UnknownNameError: The controller has no such parameter.
        OptionError: A text that is no value of its type.
        CallError: The controller does not respond.
    """
    import yaml

    present = client.parameters('controller')
    values = {}
    for name, text in texts.items():
        if name not in present:
            raise UnknownNameError('parameter of the controller', name, present)
        try:
            value = yaml.safe_load(text)
        except yaml.YAMLError:
            value = None
        if not isinstance(value, (bool, int, float, str, list)):
            raise OptionError(
                f'--set {name}={text}; expected a value, such as 0.5 or [position, torque]'
            )
        values[name] = value
    return values
