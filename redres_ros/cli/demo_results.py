"""What `redres demo` leaves behind: tables in the terminal, and files."""

import argparse
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from redres_ros.cli.files import prepare
from redres_ros.cli.parser import OptionError

if TYPE_CHECKING:
    from redres_ros.demo.demo import Demo
    from redres_ros.demo.outcome import Outcome

_PAGE = '.html'


def check_files(options: argparse.Namespace) -> None:
    """Make the folders of files; refuse those that could not be written at the end, or whose
    libraries are missing.

    Raises OptionError, FileError or FilmError.
    """
    if options.mcap:
        from redres_ros.cli.record import check_recording

        check_recording(options.mcap)
    if options.video:
        from redres_ros.view.film import check_film

        check_film(options.video)
        import_module('imageio_ffmpeg' if options.video.suffix == '.mp4' else 'PIL')
        prepare(options.video)
    if options.save_page:
        if options.save_page.suffix != _PAGE:
            raise OptionError(f'the page {options.save_page}; expected a name that ends in {_PAGE}')
        prepare(options.save_page)
        import_module('viser')


def write_results(outcome: 'Outcome', demo: 'Demo', options: argparse.Namespace) -> None:
    """Table to the terminal; summary.json, motion.csv and motion.png to the directory.

    After Ctrl-C there is no picture. To load what draws, and to draw, would take most of the time
    until the terminal is free again.

    Args:
        outcome: What came of the run.
        demo: The run.
        options: The command line.
    """
    from redres_ros.simulation.report import print_tables

    out = options.out
    outcome.write_json(out / 'summary.json')
    if outcome.motion:
        outcome.recording.write_csv(out / 'motion.csv')
    print_tables(outcome.table(demo.title))
    if outcome.motion:
        picture = out / 'motion.png'
        picture.unlink(missing_ok=True)  # that of a run before
        if not outcome.interrupted:
            _draw(outcome, demo, picture)
            print(f'plot {picture}')
        print(f'data {out}/motion.csv')
        _show(outcome, demo, options)
    else:
        print('no plot and no data: the task did not begin')


def _show(outcome: 'Outcome', demo: 'Demo', options: argparse.Namespace) -> None:
    """The film and the page that are asked for."""
    if options.video:
        from redres_ros.view.film import write_film

        write_film(outcome.recording, demo.model, demo.task, demo.title, options.video)
        print(f'film {options.video}')
    if options.save_page:
        from redres_ros.view.saved import write_page

        write_page(outcome.recording, demo.model, demo.task, demo.title, options.save_page)
        print(f'page {options.save_page}')
    if options.mcap:
        print(f'messages {options.mcap}')


def _draw(outcome: 'Outcome', demo: 'Demo', path: Path) -> None:
    """The motion; and what another law would do with an ideal arm, unless the task was repeated."""
    from redres_ros.controller import Controller
    from redres_ros.simulation.closed_loop import run
    from redres_ros.simulation.plots import Remarks, draw_motion, in_symbols

    beside = {}
    if not outcome.endurance:
        laws = ['minimum_velocity', 'minimum_acceleration']
        other = next(law for law in laws if law != demo.options.law)
        controller = Controller(demo.model, demo.law(other), outcome.recording.T)
        beside[other] = run(controller, demo.task)
    draw_motion(
        outcome.recording,
        demo.model,
        demo.task,
        in_symbols(demo.title),
        path,
        Remarks(beside, outcome.stop_reason, outcome.switches, demo.options.law),
    )
