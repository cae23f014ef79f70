"""One of our nodes as a process, which ends with this one."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from redres_ros.errors import RedresError
from redres_ros.nodes.runtime import PARENT

_PATIENCE = 5.0  # [s] between asking a process to end and killing it


class GraphError(RedresError):
    """A node that has ended, or a graph that does not do what it was asked for."""


class NodeProcess:
    """One of our nodes as a process of its own, which cannot outlive this one.

    It does not get the terminal's Ctrl-C: the process that started it ends it. What it prints goes
    to the log. The name is that of an executable of nodes/, or a module of the package, such as
    'view.page'; its own options may follow, as in 'composed --no-sim'.
    """

    def __init__(self, name: str, log: Path, parameters: Mapping[str, Any]) -> None:
        self.name = name
        self._log = log
        module, *own = name.split() if '.' in name else ['nodes.entry', *name.split()]
        command = [sys.executable, '-P', '-m', f'redres_ros.{module}', *own, '--ros-args']
        for key, value in parameters.items():
            # JSON is YAML whose texts are in quotes, whatever they look like or if they are empty.
            command += ['-p', f'{key}:={json.dumps(value)}']
        # The module comes from where this process has its own: Python would look in the working
        # directory first, and mix an installed package with a clone of it.
        path = os.pathsep.join(os.path.abspath(entry) for entry in sys.path)
        with log.open('wb') as output:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                env={**os.environ, 'PYTHONPATH': path, PARENT: str(os.getpid())},
            )
        self.pid = self._process.pid

    def status(self) -> int | None:
        return self._process.poll()

    def check(self) -> None:
        """Raise GraphError if the process has ended, with the last line that it printed."""
        status = self.status()
        if status is not None:
            printed = self.last_line() or 'it printed nothing'
            raise GraphError(f'node {self.name} ended with status {status}: {printed}')

    def last_line(self) -> str:
        lines = self._log.read_text(errors='replace').strip().splitlines()
        return lines[-1] if lines else ''

    def wait(self, timeout: float) -> int:
        """Its exit status, once it has ended. Raises subprocess.TimeoutExpired."""
        return self._process.wait(timeout)

    def interrupt(self) -> None:
        """Ask it to end, as Ctrl-C would."""
        if self.status() is None:
            self._process.send_signal(signal.SIGINT)

    def end(self) -> None:
        """Ask it to end, and kill it if it does not."""
        self.interrupt()
        try:
            self.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
