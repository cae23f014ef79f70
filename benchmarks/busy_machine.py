"""What a busy machine does to the smoothness of the demo, law by law.

    python benchmarks/busy_machine.py ideal > ideal.json
    python benchmarks/busy_machine.py busy ideal.json

The first runs the demo in lock-step, which no machine can disturb. The second runs it in real time,
with one process beside it for each processor that only counts, and prints by how much the largest
joint acceleration exceeds that of the first. What did not finish in lock-step is left out.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

LAWS = (
    'minimum_acceleration',
    'minimum_weighted_torque',
    'minimum_velocity',
    'minimum_kinetic_energy',
    'dynamically_consistent',
    'minimum_torque',
)
LIMITS = ('none', 'position,velocity,acceleration')
COMPOSED = ('minimum_acceleration',)  # laws that are run in one process, too


def main() -> int:
    """Do what the command line says."""
    if sys.argv[1] == 'ideal':
        print(json.dumps({key: peak(*key.split(), '--lockstep') for key in cases()}, indent=2))
        return 0
    ideal = json.loads(Path(sys.argv[2]).read_text())
    wanted = sys.argv[3:] or list(ideal)
    with busy_loops():
        for key in wanted:
            if ideal[key] is None:
                continue
            tell(key, ideal[key], peak(*key.split()))
            if key.split()[0] in COMPOSED:
                tell(f'{key} composed', ideal[key], peak(*key.split(), '--composed'))
    return 0


def cases() -> list[str]:
    """Law and limits."""
    return [f'{law} {limits}' for law in LAWS for limits in LIMITS]


def peak(law: str, limits: str, *options: str) -> float | None:
    """The largest norm of the joint accelerations of a demo [rad/s^2]; None if it did not finish.

    Args:
        law: By its name.
        limits: As the demo takes them.
        options: Further ones.
    """
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, '-m', 'redres_ros.cli', 'demo', '--law', law]
        command += ['--limits', limits, '--out', folder, *options]
        done = subprocess.run(command, capture_output=True, check=False)
        if done.returncode:
            return None
        summary: dict[str, Any] = json.loads((Path(folder) / 'summary.json').read_text())
        return float(summary['motion']['acceleration'][0])


def tell(key: str, ideal: float, measured: float | None) -> None:
    """One line."""
    if measured is None:
        print(f'{key}: not finished', flush=True)
    else:
        ratio = measured / ideal
        print(f'{key}: {measured:.2f} rad/s^2, {ratio:.2f} of {ideal:.2f}', flush=True)


@contextmanager
def busy_loops() -> Iterator[None]:
    """A process for each processor that does nothing but count."""
    count = os.cpu_count() or 1
    loops = [subprocess.Popen([sys.executable, '-c', 'while True: pass']) for _ in range(count)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()


if __name__ == '__main__':
    sys.exit(main())
