"""Results of a batch as they come, and in a file: CSV, a line as soon as a motion is done, or
Parquet.
"""

import csv
import json
import os
import signal
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, Self, get_origin, get_type_hints

import numpy as np

from redres_ros.errors import FileError, UnknownNameError
from redres_ros.files.signals import handled
from redres_ros.simulation.batch import Result, batch
from redres_ros.simulation.case import Case
from redres_ros.simulation.effort import Effort
from redres_ros.simulation.report import progress_bar

_ENDINGS = ('.csv', '.parquet')

_CASE = tuple(each.name for each in fields(Case))
_EFFORT = tuple(each.name for each in fields(Effort))
_RESULT = tuple(each.name for each in fields(Result) if each.name not in ('case', 'effort'))
COLUMNS = (*_CASE, *_EFFORT, *_RESULT)


def _as_row(result: Result) -> dict[str, Any]:
    """A result as a row of COLUMNS: the case as text and numbers, its figures, the versions."""
    figures = {name: getattr(result.effort, name, None) for name in _EFFORT}
    return _case_row(result.case) | figures | {name: getattr(result, name) for name in _RESULT}


def _as_result(row: Mapping[str, Any]) -> Result:
    """A result from a row, as `_as_row` makes it, or as it was read from a file."""
    case = Case(**_values(Case, _CASE, row))
    finished = row['finished'] not in ('', None)  # else there was no effort
    effort = Effort(**_values(Effort, _EFFORT, row)) if finished else None
    return Result(case, effort, **_values(Result, _RESULT, row))


def _values(kind: type, names: Sequence[str], row: Mapping[str, Any]) -> dict[str, Any]:
    """Values of fields of a dataclass, from a row."""
    types = get_type_hints(kind)
    return {name: _value(row[name], types[name]) for name in names}


def _value(given: Any, kind: Any) -> Any:
    """A value of that type, from a text or from itself."""
    text = '' if given is None else str(given)
    if kind is bool:
        return text == 'True'
    if kind is float:
        return float(text) if text else np.nan
    if kind is int:
        return int(text)
    if kind is str:
        return text
    return tuple(filter(None, text.split(','))) if get_origin(kind) is tuple else json.loads(text)


def _case_row(case: Case) -> dict[str, Any]:
    row = {name: getattr(case, name) for name in _CASE}
    for name, value in row.items():
        if isinstance(value, tuple):
            row[name] = ','.join(value)
    return row | {'gains': json.dumps(dict(case.gains), sort_keys=True)}


class ResultsFile:
    """A file of results, to which a batch that was interrupted adds the rest.

    A CSV file holds every result that was added, whatever happens next; a Parquet file is written
    when it is closed.

    Args:
        path: Path of the file; what is in it already stays.

    Raises:
        UnknownNameError: An ending other than those in _ENDINGS.
        FileError: A file that cannot be read or written, or that holds something else; pyarrow is
            missing.
    """

    def __init__(self, path: Path) -> None:
        if path.suffix not in _ENDINGS:
            raise UnknownNameError('kind of file', path.suffix, _ENDINGS)
        self._path = path
        self._is_csv = path.suffix == '.csv'
        if not self._is_csv:
            _parquet()  # now, and not when all is computed
        try:
            self._rows = self._read() if path.exists() and path.stat().st_size else []
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = path.open('a', newline='') if self._is_csv else None
        except OSError as error:
            raise FileError(f'cannot use {path}: {error.strerror}') from None
        self._before = list(self._rows)
        self._done = {_key(row) for row in self._rows}
        if self._file and not self._path.stat().st_size:
            csv.writer(self._file).writerow(COLUMNS)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def results(self) -> list[Result]:
        """Those that the file held when it was opened."""
        return [_as_result(row) for row in self._before]

    def __contains__(self, case: Case) -> bool:
        """Whether the file has a result of that case."""
        return _key(_case_row(case)) in self._done

    def add(self, result: Result) -> None:
        """Add the result of a case. Raises OSError if the disk is full."""
        row = _as_row(result)
        if self._file is None:
            self._rows.append(row)
        else:
            csv.DictWriter(self._file, COLUMNS).writerow(row)
            self._file.flush()

    def close(self) -> None:
        """Write what is not yet written, and close the file."""
        if self._file is not None:
            self._file.close()
            return
        if len(self._rows) == len(self._before):  # it was only read
            return
        pyarrow, parquet = _parquet()
        whole = pyarrow.Table.from_pylist(self._rows)
        partial = self._path.with_suffix('.part')
        parquet.write_table(whole, partial)
        os.replace(partial, self._path)

    def _read(self) -> list[dict[str, Any]]:
        """The rows of the file."""
        if not self._is_csv:
            pyarrow, parquet = _parquet()
            try:
                rows: list[dict[str, Any]] = parquet.read_table(self._path).to_pylist()
            except pyarrow.ArrowInvalid as error:
                raise FileError(f'{self._path} is not a Parquet file: {error}') from None
            return rows
        text = self._path.read_bytes()
        whole = text[: text.rfind(b'\n') + 1]  # without a last line that was not written to its end
        reader = csv.DictReader(whole.decode(errors='replace').splitlines())
        if tuple(reader.fieldnames or ()) != COLUMNS:
            raise FileError(
                f'{self._path} has other columns than the results of a batch of this version; '
                'name another file'
            )
        os.truncate(self._path, len(whole))
        return list(reader)


def run_cases(cases: Sequence[Case], file: ResultsFile | None = None) -> list[Result]:
    """The results of cases, with a progress bar; those so far if Ctrl-C or SIGTERM ends it.

    Args:
        cases: The motions.
        file: Where each result goes at once; None: nowhere.
    """
    results: list[Result] = []
    try:
        with (
            handled(signal.default_int_handler, signal.SIGTERM),  # of `timeout`, or of Slurm
            progress_bar(f'{len(cases)} motions') as progress,
        ):
            for result in batch(cases):
                results.append(result)
                if file is not None:
                    file.add(result)
                progress(len(results) / len(cases))
    except KeyboardInterrupt:
        print(f'ended after {len(results)} of {len(cases)} motions')
    return results


def _key(row: dict[str, Any]) -> str:
    """What distinguishes a case from all others, whether it was read from a file or not."""
    return repr([str(row[name]) for name in _CASE])


def _parquet() -> tuple[Any, Any]:
    """pyarrow and pyarrow.parquet. Raises FileError if they are missing."""
    try:
        import pyarrow
        import pyarrow.parquet as parquet
    except ImportError:
        raise FileError('Parquet needs pyarrow: pip install pyarrow') from None
    return pyarrow, parquet
