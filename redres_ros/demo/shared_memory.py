"""Files of Fast DDS in /dev/shm: which a process uses, and those that dead ones have left there.

A participant has a segment of its own and ports on which it listens. When it is killed they stay.
Even when it ends by itself, another one may open its port once more to write into it, and leave it.
Beside what is alive there is a file whose name ends in _el, on which it holds a lock.
"""

import fcntl
import re
from collections.abc import Iterable
from pathlib import Path

FOLDER = Path('/dev/shm')

_NAME = re.compile(r'fastrtps_(?:port\d+|[0-9a-f]{16})')
# RTPS: the ports of domain d are 7400 + 250 d and on
_FIRST_PORT = 7400
_PORTS = 250


def files_of(pid: int) -> set[str]:
    """Names of the segments and ports that a process uses; none if it has gone."""
    try:
        maps = Path(f'/proc/{pid}/maps').read_text()
    except OSError:
        return set()
    return {match for line in maps.splitlines() for match in _NAME.findall(line)}


def files_of_domain(domain: int) -> set[str]:
    """Names of the ports in /dev/shm that belong to a ROS domain by their number."""
    first = _FIRST_PORT + _PORTS * domain
    names = {f'fastrtps_port{port}' for port in range(first, first + _PORTS)}
    return {name for name in names if (FOLDER / name).exists()}


def remove_dead(names: Iterable[str]) -> list[str]:
    """Remove segments and ports that no process uses; the names of those that were removed."""
    there = [name for name in names if (FOLDER / name).exists()]
    if not there:
        return []
    in_use = _all_in_use()
    return [name for name in there if name not in in_use and _remove(name)]


def _all_in_use() -> set[str]:
    """What all processes use that we may look into."""
    in_use: set[str] = set()
    for entry in Path('/proc').iterdir():
        if entry.name.isdecimal():
            in_use |= files_of(int(entry.name))
    return in_use


def _remove(name: str) -> bool:
    """Remove one with all that belongs to it, unless somebody holds its lock."""
    lock = FOLDER / f'{name}_el'
    try:
        # While we hold the lock nobody can begin to listen there, but takes another port.
        with lock.open('ab') as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            for path in (FOLDER / name, FOLDER / f'sem.{name}_mutex', lock):
                path.unlink(missing_ok=True)
    except OSError:
        return False
    return True
