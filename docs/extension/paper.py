"""The claims of the paper that are measured, and what came of the latest `redres reproduce`."""

import csv
from collections.abc import Iterator
from pathlib import Path

from sphinx.errors import ExtensionError

from extension.markdown import plain, table
from redres_ros.paper.claims import CLAIMS

RESULTS = Path(__file__).resolve().parents[1] / 'claims.csv'  # copied from its output


def claims() -> Iterator[str]:
    """The table of claims, in our words, with what was measured."""
    results = _results()
    known = [(claim.section, claim.says) for claim in CLAIMS]
    stale = {row['claim'] for row in results} - {says for _, says in known}
    if stale:
        raise ExtensionError(f'{RESULTS} is of an older run; no such claim: {", ".join(stale)}')
    found = {(row['section'], row['claim']): row for row in results}
    rows = [_row(section, says, found.get((section, says))) for section, says in known]
    held = sum(row['held'] == 'yes' for row in results)
    yield f'Of the {len(results)} claims with figures {held} were held when they were measured.'
    yield ''
    yield from table(('in the paper', 'claim', 'held?', 'measured'), rows)


def _results() -> list[dict[str, str]]:
    """What was measured, one row a claim."""
    with RESULTS.open(encoding='utf-8', newline='') as file:
        return list(csv.DictReader(file))


def _row(section: str, says: str, result: dict[str, str] | None) -> tuple[str, ...]:
    """A claim, with what was measured if it was."""
    if result is None:
        return plain(section), plain(says), '–', ''
    held = 'held' if result['held'] == 'yes' else '**not held**'
    measured = '; '.join(filter(None, (result['measured'], result['remark'])))
    return plain(section), plain(says), held, plain(measured)
