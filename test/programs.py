"""Programs of Python that tests run to their end."""

import subprocess
import sys
from typing import Any


def run_python(*words: object, **options: Any) -> subprocess.CompletedProcess[str]:
    """What a program printed, and its status; one that hangs fails."""
    usual = {'capture_output': True, 'text': True, 'timeout': 180.0, 'check': False}
    return subprocess.run([sys.executable, *map(str, words)], **{**usual, **options})
