"""The executables. Each loads its nodes in here: help needs no ROS, and Ctrl-C ends it quietly."""

import gc
import os
import signal
import sys
from functools import partial
from itertools import takewhile
from pkgutil import resolve_name

from redres_ros.errors import RedresError, reason_of
from redres_ros.files.installation import not_installed
from redres_ros.files.processes import handled

_ROS = '--ros-args'
_NO_SIM = '--no-sim'
_NODES = {  # in modules of this package
    'composed': ['sim:SimNode', 'controller:ControllerNode', 'planner:PlannerNode'],
    'controller': ['controller:ControllerNode'],
    'planner': ['planner:PlannerNode'],
    'sim': ['sim:SimNode'],
}


def run_node(name: str, arguments: list[str] | None = None) -> int:
    """Run an executable until it ends. Without arguments it gets those of this process.

    Returns 0, 1 after an error, 2 for a wrong command line, 130 after Ctrl-C before nodes began.
    """
    arguments = sys.argv[1:] if arguments is None else arguments
    nodes = [f'redres_ros.nodes.{node}' for node in _NODES[name]]
    try:
        if {'-h', '--help'} & set(arguments):
            print(_help(name), flush=True)
            return 0
        own = list(takewhile(lambda word: word != _ROS, arguments))
        if name == 'composed' and own == [_NO_SIM]:
            del own[0], nodes[0]
        if own:
            remedy = f'parameters go as {_ROS} -p NAME:=VALUE, see --help'
            print(f'redres_{name}: got {own[0]!r}; {remedy}', file=sys.stderr)
            return 2
        gc.disable()  # to look through what is being loaded takes a tenth of the start
        with handled(lambda *_: os._exit(130), signal.SIGINT):  # modules in C swallow an exception
            from redres_ros.nodes.runtime import run_nodes

            makes = list(map(resolve_name, nodes))
        gc.freeze()
        gc.enable()
        return run_nodes(*makes, arguments=arguments)
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:  # who read our help, as `| head` does, has gone
        return 1
    except ModuleNotFoundError as error:
        print(f'redres_{name}: {not_installed(error.name or "")}', file=sys.stderr)
        return 1
    except (OSError, ImportError, RedresError) as error:
        print(f'redres_{name}: {reason_of(error)}', file=sys.stderr)
        return 1


# The executables redres_composed and so on, and those that `ros2 run redres_ros` starts.
composed = partial(run_node, 'composed')
controller = partial(run_node, 'controller')
planner = partial(run_node, 'planner')
sim = partial(run_node, 'sim')


def _help(name: str) -> str:
    from redres_ros.files.installation import share_path

    no_sim = f' [{_NO_SIM}, beside a robot]' if name == 'composed' else ''
    return f"""\
usage: redres_{name}{no_sim} [{_ROS} [-p NAME:=VALUE] [--params-file FILE.yaml] [-r __ns:=/NAME]]

The common parameters, with defaults and units: {share_path('config/redres.yaml')}
What is allowed for one of a running node: ros2 param describe /{name} PARAMETER"""


if __name__ == '__main__':  # without scripts: python -m redres_ros.nodes.entry NAME
    name = sys.argv.pop(1)
    sys.argv[0] = f'redres_{name}'  # which begins the line of an error
    sys.exit(run_node(name))
