"""The live page as a node: `redres view` beside any graph, and `redres demo --view`."""

import os
import sys
import threading
from dataclasses import dataclass

from redres_ros.files.plugins import load_plugins
from redres_ros.graph.graph_monitor import NICENESS, GraphMonitor
from redres_ros.nodes.parameters import declare
from redres_ros.nodes.policy_parameters import NONE, named
from redres_ros.nodes.runtime import Waiting, run_nodes
from redres_ros.parameter import param
from redres_ros.view.origin_check import ADDRESS, close_server, open_server
from redres_ros.view.page import Page


@dataclass(frozen=True)
class ViewParameters:
    """Parameters of the node."""

    port: int = param(8080, 'of the page; the next free one is taken', 1024, 65535)
    plugins: tuple[str, ...] = param(
        (NONE,), 'Python files with the laws, preferences and limits that the controller has'
    )
    patience: float = param(10.0, 'how long a graph may take to appear [s]', 0.0, 600.0)


class ViewNode(GraphMonitor):
    """Serves a page of the graph in its domain and namespace."""

    def __init__(self) -> None:
        super().__init__('view')
        self._settings = declare(self, ViewParameters())
        # Those of this node's own starter: what a graph names is not executed here.
        load_plugins(named(self._settings.plugins))

    def run(self, stopped: threading.Event, waiting: Waiting) -> None:
        """Wait for the graph, and serve the page until the event is set.

        Args:
            stopped: Ends it.
            waiting: How to wait.

        Raises:
            CallError: No graph has appeared.
            OriginError: A server that would let in strangers.
        """
        if not self.client.await_nodes(stopped, waiting, self._settings.patience):
            return
        server = open_server(self._settings.port, 'redres')
        try:
            page = Page(server, self)
            print(f'page: http://{ADDRESS}:{server.get_port()}', flush=True)
            page.run(stopped)
        finally:
            close_server(server)


def main(arguments: list[str] | None = None) -> int:
    """Console entry point."""
    os.nice(NICENESS)
    return run_nodes(ViewNode, arguments=arguments)


if __name__ == '__main__':
    sys.exit(main())
