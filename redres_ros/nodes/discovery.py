"""Domain, discovery and transport: variables that ROS and Fast DDS read when a process joins."""

import fcntl
import os
import random
import socket
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from rclpy.utilities import get_rmw_implementation_identifier

from redres_ros.errors import RangeError, RedresError

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
_DOMAINS = range(1, 102)  # above them the ports run into those that Linux hands out to anyone


class _DomainError(RedresError):
    """No domain is free."""


def prepare() -> None:
    """Set what the user has not set: discovery on this host only, and no shared memory.

    Where nothing is set ROS would find everybody on the network, and anybody there could command
    the arm. Shared memory of Fast DDS is left out, because opening it for a process that has just
    come can hold up all who publish for a third of a second (issue 6535 of Fast DDS); UDP over
    loopback takes messages of this size as fast. LOCALHOST of ROS would bring it back, so for Fast
    DDS a profile of our own says the same.
    """
    if not any(map(os.environ.get, CHOICES)):
        is_fast_dds = 'fastrtps' in get_rmw_implementation_identifier()
        if is_fast_dds and os.environ.get(_TRANSPORTS, _UDP) == _UDP:
            os.environ[_RANGE] = 'SUBNET'  # of the profile's network, which is this host
            os.environ[_PROFILE] = str(_LOOPBACK)
        else:
            os.environ[_RANGE] = 'LOCALHOST'
    os.environ.setdefault(_TRANSPORTS, _UDP)


@contextmanager
def joined_domain(domain: int | None) -> Iterator[None]:
    """Set a ROS domain on this host; None: as the user has it. Raises RangeError."""
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


@contextmanager
def own_domain(wanted: int | None = None) -> Iterator[int]:
    """Set the environment to a ROS domain; None: to one that no other graph on this host uses.

    Yields:
        Its number.

    Raises:
        _DomainError: Every domain is taken.
        RangeError: There is no such domain.
    """
    if wanted is not None:
        with joined_domain(wanted):
            yield wanted
        return
    lock, domain = _free_domain()
    with lock, joined_domain(domain):
        yield domain


def _free_domain() -> tuple[IO[bytes], int]:
    for domain in random.SystemRandom().sample(_DOMAINS, len(_DOMAINS)):
        lock = _claim(domain)
        if lock and not _in_use(domain):
            return lock, domain
    raise _DomainError(
        f'every ROS domain from {_DOMAINS[0]} to {_DOMAINS[-1]} is in use on this machine'
    )


def _claim(domain: int) -> IO[bytes] | None:
    """A lock against runs of ours that have no participant yet; None if another run has it."""
    try:
        path = Path(tempfile.gettempdir()) / f'redres_ros_domain_{domain}.lock'
        lock = path.open('wb')
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return None
    return lock


def _in_use(domain: int) -> bool:
    """Whether a participant listens on the domain's discovery port (RTPS: 7400 + 250 domain)."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(('', 7400 + 250 * domain))
        except OSError:
            return True
    return False
