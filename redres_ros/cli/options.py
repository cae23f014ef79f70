"""Options that several subcommands share, and how they are read."""

import argparse
from pathlib import Path

from redres_ros.errors import FileError, RangeError, RedresError


class OptionError(RedresError):
    """An option whose text cannot be read."""


class Help(argparse.ArgumentDefaultsHelpFormatter):
    """Shows defaults, but not those that are None."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        return action.help if action.default is None else super()._get_help_string(action)


def add_law(parser: argparse.ArgumentParser) -> None:
    """--law, and --damping or --forgetting-factor."""
    parser.add_argument(
        '--law', default='minimum_acceleration', metavar='NAME', help='see `redres laws`'
    )
    gain = parser.add_mutually_exclusive_group()
    gain.add_argument(
        '--damping',
        type=float,
        metavar='K_D',
        help='null-space damping k_d [1/s], 0 to 1/T; default: 10',
    )
    gain.add_argument(
        '--forgetting-factor',
        type=float,
        metavar='LAMBDA',
        help='the same as lambda = 1 - k_d T, 0 to 1',
    )


def add_loop(parser: argparse.ArgumentParser) -> None:
    """--period, --task and --dynamics of the ideal loop."""
    parser.add_argument(
        '--period', type=float, default=0.001, metavar='S', help='sampling time T [s]'
    )
    parser.add_argument(
        '--task', default='rectangle', metavar='NAME|FILE.yaml', help='points to pass'
    )
    parser.add_argument(
        '--dynamics',
        default='identified',
        metavar='NAME',
        help="inertias: identified, or cylinders (the paper's Section 5.2)",
    )


def add_domain(parser: argparse.ArgumentParser) -> None:
    """--domain of nodes that are running already."""
    parser.add_argument(
        '--domain',
        type=int,
        metavar='ID',
        help='ROS domain of a running `redres demo`; default: ROS_DOMAIN_ID',
    )


def damping(options: argparse.Namespace, T: float) -> dict[str, float]:
    """k_d from either way of giving it; empty when neither is given. Raises RangeError."""
    if options.forgetting_factor is None:
        return {} if options.damping is None else {'damping': options.damping}
    if not T > 0.0:
        raise RangeError('period', T, 1e-5, 1.0, 's')
    if not 0.0 <= options.forgetting_factor <= 1.0:
        raise RangeError('forgetting factor', options.forgetting_factor, 0.0, 1.0)
    return {'damping': (1.0 - options.forgetting_factor) / T}


def made(directory: Path) -> Path:
    """The directory, which exists now. Raises FileError."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f'cannot make the directory {directory}: {error.strerror}') from None
    return directory
