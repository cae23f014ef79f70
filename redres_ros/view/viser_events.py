"""Makes viser safe for messages from several threads.

viser 1.1 sets an asyncio.Event from whichever thread sends a message, and once more in its own
loop. The first may meet a waiter that comes or goes: 'deque mutated during iteration', which ended
the page on a busy machine.
"""

import asyncio
from typing import Any

from viser.infra import _infra
from viser.infra._async_message_buffer import AsyncMessageBuffer


class LoopEvent(asyncio.Event):
    """An event that only a running loop sets; from other threads it is left alone."""

    def set(self) -> None:
        """Wake those who wait, in the loop's own thread."""
        try:
            asyncio.get_running_loop()
        except RuntimeError:
            return
        super().set()


class _SafeBuffer(AsyncMessageBuffer):
    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.message_event = LoopEvent()


def make_thread_safe() -> None:
    """Have all servers made from here on wake their loop in its own thread only."""
    _infra.AsyncMessageBuffer = _SafeBuffer  # type: ignore[attr-defined]
