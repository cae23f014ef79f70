"""The nodes as they are: started in a ROS domain of this host, asked, and ended."""

from collections.abc import Iterable
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

# Packages of the interfaces that every node of ROS 2 has.
_COMMON = ('rcl_interfaces', 'rosgraph_msgs', 'lifecycle_msgs', 'type_description_interfaces')


@dataclass(frozen=True)
class Interfaces:
    """What a node offers."""

    published: dict[str, str]  # type by topic
    latched: set[str]  # of these topics
    subscribed: dict[str, str]
    services: dict[str, str]
    parameters: dict[str, tuple[Any, Any]]  # default and descriptor by name, in their order


@cache
def interfaces() -> dict[str, Interfaces]:
    """Those of every node, by its name."""
    with own_domain():
        start([])
        try:
            return {name: _of(cls()) for name, cls in NODES.items()}
        finally:
            rclpy.try_shutdown()


def _of(node: Node) -> Interfaces:
    try:
        publishers = list(node.publishers)
        names = sorted(node.list_parameters([], 0).names)
        return Interfaces(
            _types((each.topic_name, each.msg_type) for each in publishers),
            {
                _relative(each.topic_name)
                for each in publishers
                if each.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
            },
            _types((each.topic_name, each.msg_type) for each in node.subscriptions),
            _types((each.service_name, each.srv_type) for each in node.services),
            {
                each.name: (node.get_parameter(each.name).value, each)
                for each in node.describe_parameters(names)
                if each.description  # rclpy's own have none
            },
        )
    finally:
        node.destroy_node()


def _types(named: Iterable[tuple[str, type]]) -> dict[str, str]:
    """Package and name of each type, by topic or service."""
    packages = [(name, cls, cls.__module__.partition('.')[0]) for name, cls in named]
    return {
        _relative(name): f'{package}/{cls.__name__}'
        for name, cls, package in packages
        if package not in _COMMON
    }


def _relative(name: str) -> str:
    """As the node names it: those that are absolute on purpose keep their slash."""
    return name if name == '/diagnostics' else name.removeprefix('/')
