"""The options of every subcommand, from its parser."""

import argparse
from collections.abc import Iterator

from extension.markdown import code, plain, table
from redres_ros.cli import make_parser

_DEFAULT = '; default: '  # what follows it in a help says a default in words
_NOT_SHOWN = (argparse._HelpAction, argparse._SubParsersAction)


def commands() -> Iterator[str]:
    """A section with tables of options for each."""
    [choices] = [a for a in make_parser()._actions if isinstance(a, argparse._SubParsersAction)]
    for name, command in choices.choices.items():
        yield from (f'## redres {name}', '', plain(command.description or ''), '')
        yield from ('```sh', *_examples(command), '```', '')
        for group in command._action_groups:
            actions = [a for a in group._group_actions if _is_shown(a)]
            if actions:
                yield from table((group.title or '', 'default', 'is'), map(_option, actions))


def _is_shown(action: argparse.Action) -> bool:
    return not isinstance(action, _NOT_SHOWN) and action.help != argparse.SUPPRESS


def _examples(command: argparse.ArgumentParser) -> list[str]:
    """Command lines, one a line, as the end of the help has them."""
    return [line.strip() for line in (command.epilog or '').splitlines()[1:]]


def _option(action: argparse.Action) -> tuple[str, str, str]:
    """Names, default and meaning, as cells."""
    names = ', '.join(map(code, action.option_strings)) or code(str(action.metavar or action.dest))
    value = action.metavar if action.option_strings and action.nargs != 0 else None
    meaning, _, default = plain(action.help or '').replace('%%', '%').partition(_DEFAULT)
    if action.default not in (None, False, '', (), argparse.SUPPRESS):
        default = code(_shown(action.default))
    return f'{names} {value or ""}'.strip(), default, meaning


def _shown(default: object) -> str:
    return f'{default:g}' if isinstance(default, float) else str(default)
