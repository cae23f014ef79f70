"""The options of every subcommand, from its parser."""

import argparse
from collections.abc import Iterator

from extension.markdown import code, plain, table
from redres_ros.cli.command import make_parser
from redres_ros.cli.parser import Parser

_NOT_SHOWN = (argparse._HelpAction, argparse._SubParsersAction)


def commands() -> Iterator[str]:
    """A section with tables of options for each."""
    [choices] = [a for a in make_parser()._actions if isinstance(a, argparse._SubParsersAction)]
    helps = {action.dest: action.help or '' for action in choices._choices_actions}
    for name, command in choices.choices.items():
        if isinstance(command, Parser):
            command.declare_all(['--help'])
        yield from (f'## redres {name}', '', f'{plain(helps[name])}.', '')
        yield from ('```sh', *_examples(command), '```', '')
        for group in command._action_groups:
            actions = [a for a in group._group_actions if not isinstance(a, _NOT_SHOWN)]
            if actions:
                yield from table((group.title or '', 'default', 'is'), map(_option, actions))


def _examples(command: argparse.ArgumentParser) -> list[str]:
    """Command lines, one a line, as the end of the help has them."""
    return [line.strip() for line in (command.epilog or '').splitlines()[1:]]


def _option(action: argparse.Action) -> tuple[str, str, str]:
    names = ', '.join(map(code, action.option_strings)) or code(str(action.metavar or action.dest))
    value = action.metavar if action.option_strings and action.nargs != 0 else None
    default = '' if action.default in (None, False, '', (), argparse.SUPPRESS) else action.default
    words = [f'{names} {value or ""}'.strip(), code(str(default)), plain(action.help or '')]
    return words[0], words[1], words[2].replace('%%', '%')
