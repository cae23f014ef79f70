"""The claims that are measured, and what came of the latest `redres reproduce`."""

import csv
from collections.abc import Iterable, Iterator
from pathlib import Path

from sphinx.errors import ExtensionError

from extension.markdown import plain, table
from redres_ros.paper.claims import CLAIMS, Claim
from redres_ros.paper.claims.claim import ASSUMPTION, CONTACT, PAPER, PUBLISHED
from redres_ros.paper.contact.claims import CONTACT_CLAIMS

DOCS = Path(__file__).resolve().parents[1]
SOURCES = {'paper': PAPER, 'assumption': ASSUMPTION, 'published': PUBLISHED, 'contact': CONTACT}

Result = dict[str, str]  # a row of the file


def claims(source: str) -> Iterator[str]:
    """The table of claims of one source, in our words, with what was measured."""
    every = CONTACT_CLAIMS if source == 'contact' else CLAIMS
    # copied from the output of `redres reproduce`
    file = DOCS / ('contact.csv' if source == 'contact' else 'claims.csv')
    found = {(row['section'], row['claim']): row for row in _results(file, every)}
    wanted = [claim for claim in every if claim.source == SOURCES[source]]
    results = [(claim, found.get((claim.section, claim.says))) for claim in wanted]
    measured = [result for _, result in results if result]
    held = sum(result['held'] == 'yes' for result in measured)
    yield f'{held} of {len(measured)} held.'
    yield ''
    yield from table(('section', 'claim', 'held?', 'measured'), [_row(*each) for each in results])


def _results(path: Path, claims: Iterable[Claim]) -> list[Result]:
    """What was measured, one row a claim.

    Args:
        path: Of the file.
        claims: That it may hold.
    """
    with path.open(encoding='utf-8', newline='') as file:
        results = list(csv.DictReader(file))
    stale = {row['claim'] for row in results} - {claim.says for claim in claims}
    if stale:
        raise ExtensionError(f'{path} is of an older run; no such claim: {", ".join(stale)}')
    return results


def _row(claim: Claim, result: Result | None) -> tuple[str, ...]:
    """A claim, with what was measured if it was."""
    if result is None:
        return plain(claim.section), plain(claim.says), '–', ''
    held = 'held' if result['held'] == 'yes' else '**not held**'
    measured = '; '.join(filter(None, (result['measured'], result['remark'])))
    return plain(claim.section), plain(claim.says), held, plain(measured)
