#!/usr/bin/env python3
"""Finds private words, for which robotics and ROS have words of their own.

`scripts/lint_words.py [FILE ...]` prints each as FILE:LINE: WORD, use: …, and exits with 1 if there
are any. Without files it reads the package, its pages and its tests.
"""

import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
READ = (
    'redres_ros/**/*.py',
    'docs/**/*.md',
    'README.md',
    'CONTRIBUTING.md',
    'test/*.py',
    'examples/*.py',
)

# Private word, as a regular expression, and what takes its place.
WORDS = {
    'rooms?': 'package, module, margin',
    'tells?|told|telling': 'report, publish, distinguish',
    'hear[sd]?|hearing': 'receive, last value',
    'bears?|borne': 'tolerate, carry, have',
    'whoever': 'name who it is',
    'things?(?! go wrong)': 'name what it is',
    'glances?': 'snapshot',
    'crew': 'node group',
    'looker|spectator|sighting': 'monitor, snapshot',
    'playout': 'twist buffer',
    'astray|aside': 'deviation, cross-track error',
    'outlet': 'publisher',
    'hindrance': 'limit warning',
    'steering': 'key map, steer',
    'witness': 'reference, observer',
    'nothing special': 'no effect',
    'spare joints?': 'redundant degrees of freedom, null space',
    'forgetting(?![ -]factor)': 'forgetting factor',
    'nearness': 'conditioning',
}
PATTERN = re.compile('|'.join(rf'(?<![a-z])(?:{word})(?![a-z])' for word in WORDS), re.IGNORECASE)


def main() -> int:
    """Print what is found; 1 if there is any."""
    files = [Path(name).resolve() for name in sys.argv[1:]] or sorted(files_of_the_project())
    found = [fault for path in files for fault in faults_of(path)]
    print(*found, sep='\n', end='\n' if found else '')
    return 1 if found else 0


def files_of_the_project() -> Iterator[Path]:
    for pattern in READ:
        yield from ROOT.glob(pattern)


def faults_of(path: Path) -> Iterator[str]:
    """The private words of a file, each with its line and what takes its place."""
    name = path.relative_to(ROOT) if path.is_relative_to(ROOT) else path
    for number, row in enumerate(path.read_text(encoding='utf-8').splitlines(), start=1):
        for match in PATTERN.finditer(row.replace('_', ' ')):
            yield f'{name}:{number}: {match[0]}, use: {better(match[0])}'


def better(word: str) -> str:
    """What takes the place of a private word."""
    return next(use for private, use in WORDS.items() if re.match(private, word, re.IGNORECASE))


if __name__ == '__main__':
    sys.exit(main())
