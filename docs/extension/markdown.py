"""Tables in Markdown."""

from collections.abc import Iterable, Iterator, Sequence


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[str]:
    """The lines of a table, with an empty one after it."""
    yield _row(head)
    yield _row(['---'] * len(head))
    for row in rows:
        yield _row(row)
    yield ''


def code(text: str) -> str:
    """A text as code; nothing for an empty one."""
    return f'`{text}`' if text else ''


def plain(text: str) -> str:
    """A text in which no character means anything to Markdown."""
    for sign in ('\\', '*', '_', '<', '['):
        text = text.replace(sign, f'\\{sign}')
    return text


def _row(cells: Sequence[str]) -> str:
    return f'| {" | ".join(cell.replace("|", chr(92) + "|") for cell in cells)} |'
