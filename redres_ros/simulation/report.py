"""Progress bars and tables for the terminal: of one motion, and of laws side by side."""

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager

from rich import box
from rich.console import Console
from rich.progress import Progress
from rich.table import Table
from rich.text import Text

from redres_ros.laws import Law, law_name
from redres_ros.parameter import parameters
from redres_ros.simulation.recording import Effort, Recording

_SMALL_GAIN = 0.02  # of the first law's figure; the share of a smaller gain is noise
_OF_LABEL = ('damping', 'horizon')  # gains that it names in its own way
_WIDE = 240  # columns, if the output is not a terminal and lines need not be broken

_PEAKS = {  # norms, also figures of Effort, and their heads
    'acceleration': 'max |ddq| [rad/s^2]',
    'velocity': 'max |dq| [rad/s]',
    'torque': 'max |tau| [Nm]',
}
_WHOLE = {  # other figures of Effort, and their heads
    'squared_acceleration': 'int ddq^2 [rad^2/s^3]',
    'squared_torque': 'int tau^2 [Nm^2 s]',
    'kinetic_energy': 'int energy [J s]',
    'elbow': 'elbow path [m]',
}


def _table(
    heads: Sequence[str], rows: Iterable[Sequence[str]], *, title: str = '', note: str = ''
) -> Table:
    """A table whose first column is text and whose others are figures, aligned to the right."""
    shown = Table(
        title=Text(title, style='bold') if title else None,
        caption=Text(note) if note else None,
        box=box.SIMPLE_HEAD,
        title_justify='left',
        caption_justify='left',
    )
    for place, head in enumerate(heads):
        shown.add_column(Text(head), justify='right' if place else 'left', overflow='fold')
    for row in rows:
        shown.add_row(*map(Text, row))
    return shown


def facts(rows: Iterable[Sequence[str]], *, title: str = '') -> Table:
    """A table of labels and texts; a row of one cell is the heading of a section."""
    heading = Text(title, style='bold') if title else None
    shown = Table(title=heading, box=box.SIMPLE, show_header=False, title_justify='left')
    for row in rows:
        if len(row) == 1:
            shown.add_section()
        shown.add_row(*map(Text, row), style='bold' if len(row) == 1 else None)
    for column in shown.columns:
        column.overflow = 'fold'  # the rest of a long word stands in the next line
    return shown


def print_tables(*tables: Table) -> None:
    """Print tables, as wide as the terminal is, or as wide as they need to be without one."""
    is_terminal = sys.stdout is not None and sys.stdout.isatty()  # it is None if it was closed
    console = Console(width=None if is_terminal else _WIDE)
    for each in tables:
        console.print(each)


@contextmanager
def progress_bar(label: str) -> Iterator[Callable[[float], None]]:
    """A bar on standard error, if that is a terminal; yields a function of the fraction done that
    draws it: a thread that draws would be in the way of processes that copy this one.
    """
    console = Console(stderr=True)
    is_hidden = not console.is_terminal
    bar = Progress(transient=True, console=console, disable=is_hidden, auto_refresh=False)
    task = bar.add_task(label, total=1.0)
    with bar:
        yield lambda fraction: bar.update(task, completed=fraction, refresh=True)


def label(law: Law) -> str:
    """The label of a law in tables and plots, such as 'minimum_acceleration, k_d = 5 1/s'."""
    ahead = f', {law.horizon:g} s ahead' if law.horizon else ''
    gains = {f.name: getattr(law, f.name) for f in parameters(law) if f.name not in _OF_LABEL}
    own = [name for name in gains if gains[name] != getattr(type(law), name)]
    others = [f', {name} {gains[name]}'.removesuffix('.0') for name in own]
    damping = f', k_d = {law.damping}'.removesuffix('.0') + ' 1/s'
    return ''.join((law_name(law), ahead, *others, damping if law.has_memory else ''))


def peak_table(name: str, recording: Recording) -> Table:
    """The end of a motion, the largest norms and when, and the last error."""
    row = [name, 'no tick']
    if len(recording.data):
        peaks = [recording.peak(f'joint_{norm}_norm') for norm in _PEAKS]
        shown = [f'{value:.5g} at {t:5.2f} s' for value, t in peaks]
        error = 1e3 * recording['task_error'][-1]
        row = [name, f'{recording["t"][-1]:.3f}', *shown, f'{error:.4f}']
    return _table(('law', 'end [s]', *_PEAKS.values(), 'last error [mm]'), [row])


def comparison_tables(
    efforts: Mapping[str, Effort], title: str, least: float | None = None
) -> tuple[Table, Table]:
    """The worst moments, with the arm's limits, and the whole motion; one row a law.

    `least` is the integral of the squared acceleration of the best motion along the path.
    """
    marked = {name: _marked(efforts, name) for name in (*_PEAKS, *_WHOLE)}
    first = next(iter(efforts.values())).squared_acceleration
    possible = first - (least or 0.0)
    has_share = possible > _SMALL_GAIN * first
    worst = []
    whole = []
    for law, effort in efforts.items():
        within = f'no: {effort.violation}' if effort.violation else 'yes'
        worst.append([law, *(marked[name][law] for name in _PEAKS), within])
        whole.append([law, *(marked[name][law] for name in _WHOLE)])
        if least is not None:
            gain = first - effort.squared_acceleration
            whole[-1].append(f'{round(100.0 * gain / possible)} %' if has_share else '-')
    unfinished = [f'{law}: {each.ending}' for law, each in efforts.items() if not each.finished]
    notes = ['* least', *unfinished]
    heads = ['law', *_WHOLE.values()]
    if least is not None:
        heads.append('of the possible')
        best = 'the best motion along the path, which knows all of it, has int ddq^2'
        last = 'the last column is the share of what the first law could gain'
        if not has_share:
            last = f'the first law could gain less than {100 * _SMALL_GAIN:g} %, a share is noise'
        notes.append(f'{best} = {least:.4g}: {last}')
    return (
        _table(['law', *_PEAKS.values(), 'within the limits, torque too?'], worst, title=title),
        _table(heads, whole, note='\n'.join(notes)),
    )


def _marked(efforts: Mapping[str, Effort], name: str) -> dict[str, str]:
    """One figure of every law as text, the least of them with a star."""
    values = {law: getattr(effort, name) for law, effort in efforts.items()}
    shown = {law: f'{value:.4g}' for law, value in values.items()}
    least = shown[min(values, key=values.__getitem__)]
    return {law: f'{text}{"*" if text == least else " "}' for law, text in shown.items()}
