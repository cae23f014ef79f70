"""Progress bars and tables for the terminal."""

import math
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager

from rich import box
from rich.console import Console, Group, JustifyMethod
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from redres_ros.simulation.recording import Recording

_WIDE = 240  # columns, if the output is not a terminal and lines need not be broken

_DRAWN_EVERY = 0.1  # [s]

PEAKS = {  # of the norms that are shown, and their heads
    'acceleration': 'max |ddq| [rad/s^2]',
    'velocity': 'max |dq| [rad/s]',
    'torque': 'max |tau| [Nm]',
}


def table(
    heads: Sequence[str], rows: Iterable[Sequence[str]], *, title: str = '', note: str = ''
) -> Table:
    """A table whose first column is text and whose others are figures, aligned to the right.

    Args:
        heads: One for each column, with its unit, such as 'median [us]'.
        rows: The cells; a row of one cell is the heading of a section, an empty one a gap.
        title: Above the table.
        note: Below it.
    """
    shown = Table(
        title=Text(title, style='bold') if title else None,
        caption=Text(note) if note else None,
        box=box.SIMPLE_HEAD,
        title_justify='left',
        caption_justify='left',
    )
    for place, head in enumerate(heads):
        justify: JustifyMethod = 'right' if place else 'left'
        shown.add_column(Text(head), justify=justify, no_wrap=not place, overflow='fold')
    for row in rows:
        if row:
            style = 'bold' if len(row) == 1 and len(heads) > 1 else None
            shown.add_row(*map(Text, row), style=style)
        else:
            shown.add_section()
    return shown


def facts(rows: Iterable[Sequence[str]], *, title: str = '') -> Table:
    """A table of labels and texts; a row of one cell is the heading of a section."""
    shown = Table(
        title=Text(title, style='bold') if title else None,
        box=box.SIMPLE,
        show_header=False,
        title_justify='left',
    )
    for row in rows:
        if len(row) == 1:
            shown.add_section()
        shown.add_row(*map(Text, row), style='bold' if len(row) == 1 else None)
    for column in shown.columns:
        column.overflow = 'fold'  # the rest of a long word stands in the next line
    return shown


def print_tables(*tables: Table) -> None:
    """Print tables, as wide as the terminal is, or as wide as they need to be without one.

    In a narrow terminal their rows become columns, or tables of their own, before a figure is cut
    off.
    """
    width: int | None = _WIDE
    if sys.stdout is not None and sys.stdout.isatty():  # it is None if it was closed
        width = None
    console = Console(width=width)
    for each in tables:
        console.print(_fitting(each, console))


def _fitting(wide: Table, console: Console) -> Table | Group:
    if not _is_cut(wide, console):
        return wide
    heads = [str(column.header) for column in wide.columns]
    columns = [list(map(str, column.cells)) for column in wide.columns]
    rows = list(zip(*columns, strict=True))
    turned = _turned(heads, rows)
    parts = [turned] if not _is_cut(turned, console) else [_turned(heads, [row]) for row in rows]
    return Group(*(part for part in (wide.title, *parts, wide.caption) if part))


def _is_cut(shown: Table, console: Console) -> bool:
    """Whether a word does not fit into its column, or a column not into the terminal."""
    lines = console.render_lines(shown)
    seen = {word for line in lines for segment in line for word in segment.text.split()}
    cells = [cell for column in shown.columns for cell in (column.header, *column.cells)]
    return not seen.issuperset(word for cell in cells for word in str(cell).split())


def _turned(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    """A table of the same cells with a column for each row; a head without figures is left out."""
    names, *figures = zip(*rows, strict=True)
    lines = [(head, *cells) for head, cells in zip(heads[1:], figures, strict=True) if any(cells)]
    return table([heads[0], *names], lines)


@contextmanager
def progress_bar(label: str) -> Iterator[Callable[[float], None]]:
    """A bar on standard error, if that is a terminal; yields a function that takes the
    fraction done, 0 to 1.

    It is drawn when that function is called. A thread that draws it would be in the way of
    processes that copy this one.
    """
    console = Console(stderr=True)
    parts = (
        TextColumn('{task.description}'),
        BarColumn(),
        TextColumn('{task.percentage:3.0f} %'),
        TimeElapsedColumn(),
    )
    bar = Progress(
        *parts, transient=True, console=console, disable=not console.is_terminal, auto_refresh=False
    )
    task = bar.add_task(label, total=1.0)
    drawn_at = -math.inf

    def update(fraction: float) -> None:
        nonlocal drawn_at
        now = time.monotonic()
        if now - drawn_at >= _DRAWN_EVERY or fraction >= 1.0:
            drawn_at = now
            bar.update(task, completed=fraction, refresh=True)

    with bar:
        yield update


def peaks(recordings: Mapping[str, Recording]) -> Table:
    """One row a recording: its end, the largest norms and when, the last error."""
    heads = ('law', 'end [s]', *PEAKS.values(), 'last error [mm]')
    return table(heads, [_peaks(name, each) for name, each in recordings.items()])


def _peaks(name: str, recording: Recording) -> list[str]:
    if not len(recording.data):
        return [name, 'no tick']
    peaks = [recording.peak(f'joint_{norm}_norm') for norm in PEAKS]
    return [
        name,
        f'{recording["t"][-1]:.3f}',
        *(f'{value:.5g} at {t:5.2f} s' for value, t in peaks),
        f'{1e3 * recording["task_error"][-1]:.4f}',
    ]
