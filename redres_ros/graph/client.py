"""A client of the nodes' services and parameters."""

import threading
import time
from collections.abc import Mapping, Sequence
from typing import Any

import rclpy
from rcl_interfaces.srv import GetParameters, ListParameters, SetParametersAtomically
from rclpy.client import Client
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.task import Future
from std_srvs.srv import SetBool, Trigger

from redres_ros.errors import RedresError
from redres_ros.types import Seconds

_ASK_AGAIN = 1.0  # [s]
_LOOK = 0.001  # [s] between looks at whether a response has come
_GRAPH_LOOK = 0.1  # [s] between looks at whether a node is there
_NEEDED = ('controller', 'planner')


class CallError(RedresError):
    """A service that is missing, does not respond, or refuses."""


class GraphClient:
    """Calls the nodes' services from any thread; clients are kept, so a second call is fast.

    The node that owns them is spun elsewhere. The patience is for a service, and for its response.
    """

    def __init__(self, node: Node, patience: Seconds = 5.0) -> None:
        self._node = node
        self._patience = patience
        self._clients: dict[str, Client] = {}
        self._lock = threading.Lock()  # of the clients

    def call(self, kind: type, service: str, request: Any) -> Any:
        """The response of a service. Raises CallError.

        A server drops the response to a client that it has not discovered yet, so the request is
        made again after a second; the services of this package tolerate that.
        """
        client = self._client(kind, service)
        if not client.wait_for_service(timeout_sec=self._patience):
            raise CallError(
                f'no node offers the service {client.srv_name}; '
                f'is its node running in ROS domain {self._node.context.get_domain_id()}?'
            )
        begun = time.monotonic()
        futures: list[Future] = []
        while (elapsed := time.monotonic() - begun) < self._patience and rclpy.ok():
            if elapsed >= len(futures) * _ASK_AGAIN:
                futures.append(client.call_async(request))
            for future in futures:
                if future.done():
                    return future.result()
            time.sleep(_LOOK)
        raise CallError(f'{client.srv_name} did not respond within {self._patience:g} s')

    def trigger(self, service: str, data: bool | None = None) -> str:
        """The message of a Trigger service, or with data of a SetBool. Raises CallError."""
        if data is None:
            response = self.call(Trigger, service, Trigger.Request())
        else:
            response = self.call(SetBool, service, SetBool.Request(data=data))
        if not response.success:
            raise CallError(f'{service}: {response.message}')
        return str(response.message)

    def set_parameters(self, of: str, values: Mapping[str, Any]) -> None:
        """Set all of these parameters of a node or none. Raises CallError."""
        wanted = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
        request = SetParametersAtomically.Request(parameters=wanted)
        response = self.call(SetParametersAtomically, f'{of}/set_parameters_atomically', request)
        if not response.result.successful:
            raise CallError(f'{of} refused: {response.result.reason}')

    def parameters(self, of: str, names: Sequence[str] = ()) -> dict[str, Any]:
        """Parameters of a node, arrays as lists; without names all that have a value. Raises
        CallError.
        """
        wanted = list(names)
        if not wanted:
            listed = self.call(ListParameters, f'{of}/list_parameters', ListParameters.Request())
            wanted = listed.result.names
        request = GetParameters.Request(names=wanted)
        response = self.call(GetParameters, f'{of}/get_parameters', request)
        values = map(parameter_value_to_python, response.values)
        read = zip(wanted, values, strict=True)
        return {name: value for name, value in read if names or value is not None}

    def offers(self, of: str) -> bool:
        """Whether a node has been discovered."""
        return bool(self._client(GetParameters, f'{of}/get_parameters').service_is_ready())

    def await_nodes(self, stopped: threading.Event, patience: float) -> bool:
        """Wait until controller and planner are there; False if that was stopped first. Raises
        CallError if they have not appeared in that time [s].
        """
        until = time.monotonic() + patience
        while missing := [name for name in _NEEDED if not self.offers(name)]:
            if time.monotonic() > until:
                domain = self._node.context.get_domain_id()
                raise CallError(
                    f'no {" and no ".join(missing)} in ROS domain {domain}; start them, '
                    'as `redres demo` does, which prints its domain, or name another with --domain'
                )
            if stopped.wait(_GRAPH_LOOK):
                return False
        return True

    def _client(self, kind: type, service: str) -> Client:
        with self._lock:
            if service not in self._clients:
                self._clients[service] = self._node.create_client(kind, service)
            return self._clients[service]
