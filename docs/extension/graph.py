"""The nodes as they are: started in a ROS domain of this host, asked, and ended."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from typing import Any

import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy

from redres_ros.nodes.controller import ControllerNode
from redres_ros.nodes.planner import PlannerNode
from redres_ros.nodes.runtime import own_domain, start
from redres_ros.nodes.sim import SimNode

NODES = {'sim': SimNode, 'controller': ControllerNode, 'planner': PlannerNode}

# Interfaces that every node of ROS 2 has.
_COMMON_TOPICS = {'/rosout', '/parameter_events', '/clock'}
_COMMON_SERVICES = (
    'describe_parameters',
    'get_parameter_types',
    'get_parameters',
    'get_type_description',
    # of the life cycle
    'change_state',
    'get_available_states',
    'get_available_transitions',
    'get_state',
    'get_transition_graph',
    'list_parameters',
    'set_parameters',
    'set_parameters_atomically',
)


@dataclass(frozen=True)
class Parameter:
    """One parameter of a node, as the node describes it."""

    name: str
    default: Any
    description: str
    allowed: str
    live: bool


@dataclass(frozen=True)
class Interfaces:
    """What a node offers.

    Args:
        published: Type and whether it is latched, by topic.
        subscribed: Type by topic.
        services: Type by name.
        parameters: In the order of their names.
    """

    published: dict[str, tuple[str, bool]]
    subscribed: dict[str, str]
    services: dict[str, str]
    parameters: tuple[Parameter, ...]


@cache
def interfaces() -> dict[str, Interfaces]:
    """Those of every node, by its name."""
    with own_domain():
        start([])
        try:
            return {name: _of(cls) for name, cls in NODES.items()}
        finally:
            rclpy.try_shutdown()


def _of(cls: type[Node]) -> Interfaces:
    with _made(cls) as node:
        published = {
            _relative(p.topic_name): (
                _type(p.msg_type),
                p.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL,
            )
            for p in node.publishers
            if p.topic_name not in _COMMON_TOPICS
        }
        subscribed = {
            _relative(s.topic_name): _type(s.msg_type)
            for s in node.subscriptions
            if s.topic_name not in _COMMON_TOPICS
        }
        services = {
            _relative(s.service_name): _type(s.srv_type)
            for s in node.services
            if s.service_name.rpartition('/')[2] not in _COMMON_SERVICES
        }
        return Interfaces(published, subscribed, services, tuple(_parameters(node)))


@contextmanager
def _made(cls: type[Node]) -> Iterator[Node]:
    node = cls()
    try:
        yield node
    finally:
        node.destroy_node()


def _parameters(node: Node) -> Iterator[Parameter]:
    names = sorted(node.list_parameters([], 0).names)
    for described in node.describe_parameters(names):
        if not described.description:
            continue  # of rclpy's own
        yield Parameter(
            described.name,
            node.get_parameter(described.name).value,
            described.description,
            _allowed(described),
            not described.read_only,
        )


def _allowed(described: Any) -> str:
    ranges: Iterable[Any] = (*described.floating_point_range, *described.integer_range)
    for span in ranges:
        return f'{span.from_value:g} to {span.to_value:g}'
    return described.additional_constraints.removeprefix('one of: ')


def _relative(name: str) -> str:
    """As the node names it: those that are absolute on purpose keep their slash."""
    return name if name == '/diagnostics' else name.removeprefix('/')


def _type(cls: type) -> str:
    package = cls.__module__.partition('.')[0]
    return f'{package}/{cls.__name__}'
