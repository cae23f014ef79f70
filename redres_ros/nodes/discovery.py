"""Discovery and transport of the nodes, set by environment variables that ROS and Fast
DDS read when a process joins.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rclpy.utilities import get_rmw_implementation_identifier

from redres_ros.errors import RangeError

HIGHEST_DOMAIN = 232  # the last one whose ports exist

_RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
_PROFILE = 'FASTRTPS_DEFAULT_PROFILES_FILE'
_TRANSPORTS = 'FASTDDS_BUILTIN_TRANSPORTS'
_UDP = 'UDPv4'

# A user who sets one of these has decided which nodes find each other.
CHOICES = (
    _RANGE,
    _PROFILE,
    'ROS_STATIC_PEERS',
    'ROS_LOCALHOST_ONLY',
    'ROS_DISCOVERY_SERVER',
    'FASTDDS_DEFAULT_PROFILES_FILE',
)
_LOOPBACK = Path(__file__).with_name('loopback.xml')


def prepare() -> None:
    """Set what the user has not set: discovery on this host only, and no shared memory.

    Where nothing is set ROS would find everybody on the network, and anybody there could command
    the arm. Shared memory of Fast DDS is left out, because opening it for a process that has just
    come can hold up all who publish for a third of a second (issue 6535 of Fast DDS); UDP over
    loopback takes messages of this size as fast. LOCALHOST of ROS would bring it back, so for Fast
    DDS a profile of our own says the same.
    """
    if not any(map(os.environ.get, CHOICES)):
        if _is_fast_dds() and os.environ.get(_TRANSPORTS, _UDP) == _UDP:
            os.environ[_RANGE] = 'SUBNET'  # of the profile's network, which is this host
            os.environ[_PROFILE] = str(_LOOPBACK)
        else:
            os.environ[_RANGE] = 'LOCALHOST'
    os.environ.setdefault(_TRANSPORTS, _UDP)


@contextmanager
def joined_domain(domain: int | None) -> Iterator[None]:
    """Set the environment to a ROS domain on this host; None leaves it as the user has it.

    Raises RangeError for a domain that there is not.
    """
    if domain is not None and not 0 <= domain <= HIGHEST_DOMAIN:
        raise RangeError('ROS domain', domain, 0, HIGHEST_DOMAIN)
    kept = dict(os.environ)
    if domain is not None:
        for name in CHOICES:
            os.environ.pop(name, None)
        os.environ['ROS_DOMAIN_ID'] = str(domain)
        prepare()
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(kept)


def _is_fast_dds() -> bool:
    return 'fastrtps' in get_rmw_implementation_identifier()
