"""The command `redres`."""

import argparse
import sys

from redres_ros.cli import bench, demo, laws, paper, simulate, watch
from redres_ros.errors import RedresError

_GROUPS = (demo, simulate, paper, laws, watch, bench)  # in the order of `redres --help`
_REMEDY = "install everything with: pip install 'redres_ros[ros]'"


def main(arguments: list[str] | None = None) -> int:
    """Run one subcommand; 0 only when the thing asked for happened, 1 when it did not, 2 for a
    wrong command line.
    """
    options = _parser().parse_args(arguments)
    try:
        return options.run(options)
    except ModuleNotFoundError as error:
        if (error.name or '').startswith('redres_ros'):
            raise
        print(
            f'redres {options.command}: the package {error.name} is not installed; {_REMEDY}',
            file=sys.stderr,
        )
        return 1
    except RedresError as error:
        print(f'redres {options.command}: {error}', file=sys.stderr)
        return 1
    except BrokenPipeError:  # the reader of our output, as in `redres laws | head`, has gone
        sys.stderr.close()
        return 1
    except KeyboardInterrupt:
        return 130


def _parser() -> argparse.ArgumentParser:
    description = 'Redundancy resolution for arms behind a position interface.'
    parser = argparse.ArgumentParser(prog='redres', description=description)
    commands = parser.add_subparsers(dest='command', required=True, metavar='COMMAND')
    for group in _GROUPS:
        group.add(commands)
    return parser
