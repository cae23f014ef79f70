"""The executables. Each loads its node in here: help needs no ROS, and Ctrl-C ends it quietly."""

import sys
from functools import partial
from importlib import import_module
from itertools import takewhile

from redres_ros.errors import RedresError, reason_of
from redres_ros.files.installation import not_installed

_ROS = '--ros-args'
_PURPOSES = {
    'composed': 'The nodes sim, controller and planner in one process; with --no-sim a robot is '
    'in place of the sim.',
    'controller': 'One joint_states message in, one joint_command out.',
    'planner': "Streams a task's velocities, one cartesian_velocity for each joint_states.",
    'sim': 'A fake robot controller with a simulated arm. It is the clock of the graph.',
}
_OPTIONS = {'composed': ('--no-sim',)}  # of an executable, before those of ROS


def run_node(name: str, arguments: list[str] | None = None) -> int:
    """Run the node of a module until it ends. Without arguments it gets those of this process.

    Returns the exit status: 0, 1 after an error, 2 for a wrong command line, or 130 after Ctrl-C
    before the node began.
    """
    arguments = sys.argv[1:] if arguments is None else arguments
    options = _OPTIONS.get(name, ())
    try:
        if {'-h', '--help'} & set(arguments):
            print(_help(name, options), flush=True)
            return 0
        for word in takewhile(lambda word: word != _ROS, arguments):
            if word not in options:
                remedy = f'parameters go as {_ROS} -p NAME:=VALUE, see --help'
                print(f'redres_{name}: got {word!r}; {remedy}', file=sys.stderr)
                return 2
        status: int = import_module(f'redres_ros.nodes.{name}').main()
        return status
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


def _help(name: str, options: tuple[str, ...]) -> str:
    from redres_ros.files.installation import share_path

    called = ' '.join([f'redres_{name}', *(f'[{option}]' for option in options)])
    return f"""\
usage: {called} [{_ROS} [-p NAME:=VALUE ...] [--params-file FILE.yaml] [-r __ns:=/NAME]]

{_PURPOSES[name]}

The common parameters, with defaults and units: {share_path('config/redres.yaml')}
What is allowed for one of a running node: ros2 param describe /{name} PARAMETER"""
