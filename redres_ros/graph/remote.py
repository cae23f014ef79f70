"""Orders to the nodes, from any thread, by clients that stay: an order is on its way at once."""

import threading
import time
from collections.abc import Mapping
from typing import Any

from rcl_interfaces.srv import GetParameters, ListParameters, SetParametersAtomically
from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from redres_ros.graph.client import CallError, ask, check_set, parameters_of, setting
from redres_ros.nodes.runtime import Waiting

STEERED = ('controller', 'sim')  # the nodes whose parameters are set

_PATIENCE = 120.0  # [s] for a graph to appear, which may have to be compiled first
_GLANCE = 0.1  # [s] between looks at whether it is there
_SETTLING = 0.5  # [s] for the rest of it to be discovered
_NEEDED = ('controller', 'planner')
_SERVICES = {
    'planner/start': Trigger,
    'planner/stop': Trigger,
    'sim/reset': Trigger,
    'controller/hold': SetBool,
}


class Remote:
    """Calls what the nodes offer.

    Args:
        node: Has the clients; is spun by somebody else.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._clients = {
            service: node.create_client(kind, service) for service, kind in _SERVICES.items()
        }
        for of in STEERED:
            service = f'{of}/set_parameters_atomically'
            self._clients[service] = node.create_client(SetParametersAtomically, service)
        for of in (*STEERED, 'planner'):
            for kind, service in ((ListParameters, 'list'), (GetParameters, 'get')):
                name = f'{of}/{service}_parameters'
                self._clients[name] = node.create_client(kind, name)

    def offers(self, of: str) -> bool:
        """Whether a node is there, as far as is known by now."""
        return bool(self._clients[f'{of}/get_parameters'].service_is_ready())

    def await_nodes(
        self, stopped: threading.Event, waiting: Waiting, patience: float = _PATIENCE
    ) -> bool:
        """Whether the graph is there; False where it need not be any more.

        Args:
            stopped: Ends the waiting.
            waiting: How to wait.
            patience: How long [s].

        Raises:
            CallError: It has not appeared.
        """
        until = time.monotonic() + patience
        while not all(map(self.offers, _NEEDED)):
            if stopped.is_set():
                return False
            if time.monotonic() > until:
                domain = self._node.context.get_domain_id()
                raise CallError(
                    f'no {" and no ".join(_NEEDED)} in ROS domain {domain}; '
                    'start them, as with `redres demo`, which prints its domain, '
                    'or name another with --domain'
                )
            waiting.sleep(_GLANCE)
        waiting.sleep(_SETTLING)
        return not stopped.is_set()

    def trigger(self, service: str) -> str:
        """What the node says to a call of a Trigger service. Raises CallError."""
        return _said(service, self._call(service, Trigger.Request()))

    def hold(self, held: bool) -> str:
        """What the controller says to holding the arm, or following again. Raises CallError."""
        service = 'controller/hold'
        return _said(service, self._call(service, SetBool.Request(data=held)))

    def set_parameters(self, of: str, values: Mapping[str, Any]) -> None:
        """Set all of these parameters of a node or none.

        Args:
            of: Name of the node.
            values: By the names of the parameters.

        Raises:
            CallError: The node does not answer, or refuses, with its reason.
        """
        check_set(of, self._call(f'{of}/set_parameters_atomically', setting(values)))

    def parameters(self, of: str) -> dict[str, Any]:
        """All parameters of a node. Raises CallError."""
        return parameters_of(of, lambda _, service, request: self._call(service, request))

    def _call(self, service: str, request: Any) -> Any:
        return ask(self._clients[service], request)


def _said(service: str, response: Any) -> str:
    if not response.success:
        raise CallError(f'{service}: {response.message}')
    return str(response.message)
