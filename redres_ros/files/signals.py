"""Signals of the operating system, handled otherwise within a block."""

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

_Handler = Callable[[int, FrameType | None], object] | signal.Handlers


def handle(handler: _Handler, *numbers: signal.Signals) -> None:
    """Have signals go to a handler from now on.

    Args:
        handler: What `signal.signal` takes.
        numbers: Numbers of the signals, such as SIGINT.
    """
    for number in numbers:
        signal.signal(number, handler)


@contextmanager
def handled(handler: _Handler, *numbers: signal.Signals) -> Iterator[None]:
    """Send signals to a handler within the block; restore the previous handler afterwards.

    Args:
        handler: What `signal.signal` takes.
        numbers: Numbers of the signals, such as SIGINT.
    """
    before = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        for number, usual in before.items():
            signal.signal(number, usual)


@contextmanager
def _swallowed_quietly() -> Iterator[None]:
    """Have Python not print the KeyboardInterrupt that a callback from C swallows."""
    usual = sys.unraisablehook

    def report(unraisable: Any) -> None:
        if not issubclass(unraisable.exc_type, KeyboardInterrupt):
            usual(unraisable)

    sys.unraisablehook = report
    try:
        yield
    finally:
        sys.unraisablehook = usual


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

    def note(number: int, frame: FrameType | None) -> None:
        interrupts.append(number)
        signal.default_int_handler(number, frame)

    with handled(note, signal.SIGINT), _swallowed_quietly():
        yield
    if interrupts:
        raise KeyboardInterrupt
