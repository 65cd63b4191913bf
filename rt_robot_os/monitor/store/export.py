# Copyright 2026 The rt_robot_os authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Export of any number of observations: read a page at a time and written while reading."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Iterator
import csv
import io
from typing import Any
from typing import Final

from rt_robot_os.monitor.store.codes import code_of
from rt_robot_os.monitor.store.codes import LOINC
from rt_robot_os.monitor.store.fhir import bundle
from rt_robot_os.monitor.store.fhir import instant
from rt_robot_os.monitor.store.store import Store

#: Rows in memory at a time.
PAGE_ROWS: Final = 2000
COLUMNS: Final = ('time', 'person', 'sign', 'value', 'unit', 'quality', 'source', 'robot', 'loinc',
                  't_ns', 'arrived_ns', 'boot', 'seq')
#: Spreadsheets treat a string that begins with one of these as a formula.
_FORMULA: Final = ('=', '+', '-', '@', '\t', '\r')

Clean = Callable[[str], str]


def rows(store: Store, person: str, sign: str | None, start_ns: int, end_ns: int
         ) -> Iterator[dict[str, Any]]:
    """
    Yield observations in order of time.

    :raises StoreError: the database is unavailable; the observations so far are incomplete.
    """
    after: tuple[int, int] | None = None
    while page := store.observations(person, sign, start_ns, end_ns, PAGE_ROWS, after):
        yield from page
        after = page[-1]['t_ns'], page[-1]['id']


def as_csv(found: Iterable[dict[str, Any]], clean: Clean = str) -> Iterator[str]:
    """
    Write observations as CSV (RFC 4180), with a header.

    :param clean: replaces names of people in names of sensors.
    """
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(COLUMNS)
    for number, row in enumerate(found, 1):
        code = code_of(row['code'])
        writer.writerow((
            instant(row['t_ns']), _plain(row['person']), row['code'],
            '' if row['value'] is None else repr(row['value']), row['unit'], row['quality'],
            _plain(clean(row['source'])), _plain(row['robot']),
            code.code if code.system == LOINC else '', row['t_ns'], row['arrived_ns'],
            _plain(row['boot']), row['seq']))
        if number % 200 == 0:
            yield _taken(text)
    yield _taken(text)


def as_fhir(person: str, found: Iterable[dict[str, Any]], now_ns: int, clean: Clean = str
            ) -> Iterator[str]:
    """Write observations as a FHIR R4 bundle, in chunks."""
    parts: list[str] = []
    for part in bundle(person, ({**row, 'source': clean(row['source'])} for row in found), now_ns):
        parts.append(part)
        if len(parts) >= 100:
            yield ''.join(parts)
            parts.clear()
    yield ''.join(parts)


def _plain(text: str) -> str:
    return f"'{text}" if text.startswith(_FORMULA) else text


def _taken(text: io.StringIO) -> str:
    found = text.getvalue()
    text.seek(0)
    text.truncate()
    return found
