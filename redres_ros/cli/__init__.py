"""The command `redres`."""

import atexit
import gc
import os

# Matrices of seven joints are no work for several threads, and a process that shares its work by
# making copies of itself should have one thread only. Read when numpy is loaded.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')


def main(arguments: list[str] | None = None) -> int:
    """Run one subcommand.

    Everything else is loaded in here, so that Ctrl-C while Python still loads ends quietly too.

    Args:
        arguments: What follows the word redres; None: those of this process.

    Returns:
        0 if the command did what it was asked to do, 1 if not, 2 for a wrong command line, and
        130 after Ctrl-C.
    """
    # At its end Python would look for garbage in all that was loaded: 0.15 s after a demo.
    atexit.register(gc.freeze)
    try:
        from redres_ros.files.streams import open_error_output

        open_error_output()
        from redres_ros.cli.command import run_command

        return run_command(arguments)
    except KeyboardInterrupt:
        return 130
