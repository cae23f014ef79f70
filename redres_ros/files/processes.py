"""Processes: their standard streams and signals, and their end with a parent."""

import ctypes
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

_Handler = Callable[[int, FrameType | None], object] | signal.Handlers


def open_error_output() -> None:
    """Discard errors if standard error is closed, as after `redres demo 2>&-`: rclpy needs one, and
    the first file that is opened would take its number, into which libraries in C write.
    """
    if sys.stderr is None:
        sys.stderr = open(os.devnull, 'w')  # noqa: SIM115, for as long as the process lives


def end_with_parent(number: signal.Signals) -> None:
    """Have the kernel send this process a signal when its parent dies."""
    ctypes.CDLL(None).prctl(1, number)  # PR_SET_PDEATHSIG of Linux


@contextmanager
def handled(handler: _Handler, *numbers: signal.Signals) -> Iterator[None]:
    """Send signals to a handler within the block; restore the previous handler afterwards."""
    before = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        for number, usual in before.items():
            signal.signal(number, usual)


@contextmanager
def interruptible() -> Iterator[None]:
    """Have Ctrl-C end what is in the block, even if the block swallows it, as callbacks from C do.

    Raises KeyboardInterrupt at the latest when the block is left. Handlers of others than Python's
    own, and threads, which get no signals, are left alone.
    """
    in_main = threading.current_thread() is threading.main_thread()
    if not in_main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    interrupts: list[int] = []
    usual = sys.unraisablehook

    def _note(number: int, frame: FrameType | None) -> None:
        interrupts.append(number)
        signal.default_int_handler(number, frame)

    def _report(unraisable: Any) -> None:
        if not issubclass(unraisable.exc_type, KeyboardInterrupt):  # which a callback swallowed
            usual(unraisable)

    sys.unraisablehook = _report
    try:
        with handled(_note, signal.SIGINT):
            yield
    finally:
        sys.unraisablehook = usual
    if interrupts:
        raise KeyboardInterrupt
