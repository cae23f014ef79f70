"""Calls to the nodes' services, for those who have no ros2 command line."""

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import rclpy
from rcl_interfaces.srv import GetParameters, ListParameters, SetParametersAtomically
from rclpy.client import Client
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.task import Future

from redres_ros.errors import RedresError


class CallError(RedresError):
    """A service that is not there, does not answer, or says no."""


PATIENCE = 5.0  # [s] for a service to be found, and for its answer
_ASK_AGAIN = 1.0  # [s]
_LOOK = 0.001  # [s] between looks at whether an answer has come


def call(node: Node, kind: type, service: str, request: Any, timeout: float = PATIENCE) -> Any:
    """The response of a service.

    A server drops the answer to a client that it has not discovered yet, so the request is made
    again after a second; the services of this package bear that.

    Args:
        node: Asks; must be spun by somebody else.
        kind: Type of the service.
        service: Its name.
        request: What is asked.
        timeout: How long to wait for the service, and for its answer [s].

    Raises:
        CallError: Nobody offers the service, or it does not answer.
    """
    client = node.create_client(kind, service)
    try:
        return ask(client, request, timeout)
    finally:
        node.destroy_client(client)


def ask(client: Client, request: Any, timeout: float = PATIENCE) -> Any:
    """The response to a client that stays, as with `call`.

    Args:
        client: Its node must be spun by somebody else.
        request: What is asked.
        timeout: How long to wait for the service, and for its answer [s].

    Raises:
        CallError: Nobody offers the service, or it does not answer.
    """
    service = client.srv_name
    if not client.wait_for_service(timeout_sec=timeout):
        domain = client.context.get_domain_id()
        raise CallError(
            f'nobody offers the service {service}; is its node running in ROS domain {domain}?'
        )
    until = time.monotonic() + timeout
    futures: list[Future] = []
    try:
        while time.monotonic() < until and rclpy.ok():
            futures.append(client.call_async(request))
            response = _first(futures, min(until, time.monotonic() + _ASK_AGAIN))
            if response is not None:
                return response
    finally:
        for future in futures:
            client.remove_pending_request(future)
    raise CallError(f'{service} did not answer within {timeout:g} s')


def _first(futures: Sequence[Future], until: float) -> Any:
    """The result of the first one that is done; None if none is in time."""
    while time.monotonic() < until and rclpy.ok():
        for future in futures:
            if future.done():
                return future.result()
        time.sleep(_LOOK)
    return None


def set_parameters(
    node: Node, of: str, values: Mapping[str, Any], timeout: float = PATIENCE
) -> None:
    """Set all parameters of another node or none.

    Args:
        node: Asks; must be spun by somebody else.
        of: Name of the other node.
        values: By the names of the parameters.
        timeout: How long to wait for the node, and for its answer [s].

    Raises:
        CallError: The node does not answer, or refuses, with its reason.
    """
    service = f'{of}/set_parameters_atomically'
    check_set(of, call(node, SetParametersAtomically, service, setting(values), timeout))


def setting(values: Mapping[str, Any]) -> SetParametersAtomically.Request:
    """The request to set parameters to these values, by their names."""
    wanted = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
    return SetParametersAtomically.Request(parameters=wanted)


def check_set(of: str, response: SetParametersAtomically.Response) -> None:
    """Raise CallError where a node did not set what it was to.

    Args:
        of: Name of the node.
        response: What it said.
    """
    if not response.result.successful:
        raise CallError(f'{of} refused: {response.result.reason}')


def read_parameters(node: Node, of: str, timeout: float = PATIENCE) -> dict[str, Any]:
    """All parameters of another node that have a value.

    Args:
        node: Asks; must be spun by somebody else.
        of: Name of the other node.
        timeout: How long to wait for the node, and for each answer [s].

    Raises:
        CallError: The node does not answer.
    """
    read = parameters_of(of, partial(call, node, timeout=timeout))
    return {name: _plain(value) for name, value in read.items()}


def parameters_of(of: str, ask_for: Callable[[type, str, Any], Any]) -> dict[str, Any]:
    """All parameters of another node that have a value.

    Args:
        of: Name of the other node.
        ask_for: Gives the response to type of a service, its name and a request.

    Raises:
        CallError: The node does not answer.
    """
    listed = ask_for(ListParameters, f'{of}/list_parameters', ListParameters.Request())
    names = listed.result.names
    request = GetParameters.Request(names=names)
    values = ask_for(GetParameters, f'{of}/get_parameters', request).values
    read = zip(names, map(parameter_value_to_python, values), strict=True)
    return {name: value for name, value in read if value is not None}


def _plain(value: Any) -> Any:
    """Arrays as lists, which YAML can hold."""
    return value if isinstance(value, (bool, int, float, str)) else list(value)
