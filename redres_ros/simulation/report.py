"""What a person sees in the terminal: a progress bar and a table of peaks."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from redres_ros.simulation.recording import Recording


@contextmanager
def progress_bar(label: str) -> Iterator[Callable[[float], None]]:
    """A bar on standard error, if that is a terminal; yields a function that is told the share
    done, 0 to 1.
    """
    console = Console(stderr=True)
    parts = (
        TextColumn('{task.description}'),
        BarColumn(),
        TextColumn('{task.percentage:3.0f} %'),
        TimeElapsedColumn(),
    )
    bar = Progress(*parts, transient=True, console=console, disable=not console.is_terminal)
    with bar:
        task = bar.add_task(label, total=1.0)
        yield lambda share: bar.update(task, completed=share)


def peaks(recordings: Mapping[str, Recording]) -> str:
    """A table with one line a recording: end, largest norms and when, last error."""
    heads = ''.join(f'{head:>23}' for head in ('|ddq| [rad/s2]', '|dq| [rad/s]', '|tau| [Nm]'))
    lines = [f'{"law":<26}{"end [s]":>9}{heads}{"last error [mm]":>17}']
    for name, recording in recordings.items():
        if not len(recording.data):
            lines.append(f'{name:<26}  no tick')
            continue
        cells = [
            f'{value:.5g} at {t:5.2f} s'
            for value, t in (
                recording.peak(f'joint_{what}_norm')
                for what in ('acceleration', 'velocity', 'torque')
            )
        ]
        lines.append(
            f'{name:<26}{recording["t"][-1]:9.3f}'
            + ''.join(f'{cell:>23}' for cell in cells)
            + f'{1e3 * recording["task_error"][-1]:17.4f}'
        )
    return '\n'.join(lines)
