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

"""
Recordings of monitors: which of their columns are vital signs, and the samples of each.

CSV with a header (any delimiter, any order of columns, any of many names) and WFDB records of
numerics. A cell without a number is not a sample.
"""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
import csv
from dataclasses import dataclass
from dataclasses import field
from datetime import datetime
import gzip
import io
import math
from pathlib import Path
import re
from statistics import median
from typing import Final
import zlib

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.health.waveforms import read_record
from rt_robot_os.messages.signs import Consciousness
from rt_robot_os.messages.signs import SIGNS

#: Names of columns in lower case letters and digits, of each sign the preferred first.
COLUMNS: Final[Mapping[str, tuple[str, ...]]] = {
    'pulse_per_min': ('pulsepermin', 'hr', 'heartrate', 'ecghr', 'hrecg', 'pulse', 'pulserate',
                      'pr', 'bpm', 'spo2pulse', 'plethhr', 'prspo2'),
    'respiration_per_min': ('respirationpermin', 'resp', 'rr', 'respiration', 'resprate',
                            'respirationrate', 'respiratoryrate', 'imprr', 'awrr', 'co2rr'),
    'spo2_percent': ('spo2percent', 'spo2', 'sao2', 'sats', 'oxygensaturation', 'plethspo2'),
    'systolic_mmhg': ('systolicmmhg', 'abpsys', 'artsys', 'ibpsys', 'abps', 'nbpsys', 'nibpsys',
                      'nbps', 'nibps', 'sbp', 'sys', 'systolic', 'systolicbp', 'bpsys',
                      'artsbp', 'nibpsbp'),
    'diastolic_mmhg': ('diastolicmmhg', 'abpdias', 'abpdia', 'artdias', 'artdia', 'ibpdia', 'abpd',
                       'nbpdias', 'nbpdia', 'nibpdias', 'nibpdia', 'nbpd', 'nibpd', 'dbp', 'dias',
                       'dia', 'diastolic', 'diastolicbp', 'bpdia', 'artdbp', 'nibpdbp'),
    'body_temperature': ('bodytemperature', 'temp', 'temperature', 'tempc', 'bt', 'tblood',
                         'tcore', 'tskin', 'btemp'),
    'consciousness': ('consciousness', 'acvpu', 'avpu', 'loc'),
    'oxygen_l_per_min': ('oxygenlpermin', 'oxygen', 'o2', 'o2flow', 'supplementaloxygen',
                         'onoxygen'),
}
_TIMES_S: Final[Mapping[str, float]] = {
    'minute': 60.0, 'minutes': 60.0, 'min': 60.0, 'mins': 60.0, 'tmin': 60.0, 'timemin': 60.0,
    'timeminutes': 60.0, 'second': 1.0, 'seconds': 1.0, 's': 1.0, 'sec': 1.0, 'secs': 1.0,
    't': 1.0, 'ts': 1.0, 'time': 1.0, 'times': 1.0, 'timesec': 1.0, 'timeseconds': 1.0,
    'elapsed': 1.0, 'elapsedtime': 1.0, 'elapseds': 1.0, 'timestamp': 1.0, 'datetime': 1.0,
    'date': 1.0, 'ms': 0.001, 'tms': 0.001, 'timems': 0.001, 'millis': 0.001,
    'timestampms': 0.001, 'us': 1e-6, 'tus': 1e-6, 'timeus': 1e-6, 'ns': 1e-9, 'timens': 1e-9,
    'tns': 1e-9, 'stampns': 1e-9, 'timestampns': 1e-9, 'hour': 3600.0, 'hours': 3600.0,
    'h': 3600.0, 'timeh': 3600.0, 'timehours': 3600.0}
_CLOCK: Final = re.compile(r'(?:(\d+):)?(\d+):(\d+(?:\.\d+)?)')
_MINDS: Final = {mind.name.lower(): float(mind) for mind in Consciousness} | {
    mind.name[0].lower(): float(mind) for mind in Consciousness}
_WORDS: Final = {'air': 0.0, 'no': 0.0, 'false': 0.0, 'yes': 1.0, 'true': 1.0, 'oxygen': 1.0}
_FAHRENHEIT_FROM: Final = 70.0
# Decimals of times in s: a rate in a header is not always exact.
_DIGITS: Final = 6
_GZIP: Final = b'\x1f\x8b'
_MOST_BYTES: Final = 1 << 30


@dataclass
class Column:
    """
    Samples of one sensor.

    :ivar name: of the column.
    :ivar sign: that the sensor measures.
    :ivar samples: times in s from the start of the recording, and values.
    """

    name: str
    sign: str
    samples: list[tuple[float, float]] = field(default_factory=list)


@dataclass
class VitalsRecording:
    """
    Recording of one person by a monitor.

    :ivar columns: those of signs; of each sign the preferred first.
    :ivar ignored: the other columns.
    :ivar rows: number of rows.
    :ivar period_s: median time between rows.
    :ivar length_s: of the recording, the last row included.
    """

    columns: Sequence[Column]
    ignored: Sequence[str]
    rows: int
    period_s: float
    length_s: float


def read_recording(path: Path) -> VitalsRecording:
    """
    Read a recording: CSV, or a WFDB record (its ``.hea``).

    :raises ConfigError: the file cannot be read, or has no time or no sign.
    """
    if path.suffix.lower() in ('.hea', '.dat', '.mat') or (
            not path.is_file() and path.with_suffix('.hea').is_file()):
        return _of_record(path)
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise ConfigError([f'{str(path)!r} is larger than 1 GiB'])
        text = _read(path)
    except (OSError, EOFError, zlib.error) as error:
        raise ConfigError([f'{str(path)!r} cannot be read: {error}']) from error
    return _of_text(text, str(path))


def _read(path: Path) -> str:
    with path.open('rb') as file:
        data = file.read()
    if data.startswith(_GZIP):
        with gzip.open(path) as packed:
            data = packed.read(_MOST_BYTES)
    return data.decode('utf-8-sig', errors='replace')


def _of_record(path: Path) -> VitalsRecording:
    record = read_record(path)
    times = [place / record.rate_hz for place in range(max(
        (len(each.samples) for each in record.signals), default=0))]
    cells = [(each.name or 'signal', each.unit, [float(value) for value in each.samples])
             for each in record.signals]
    return _recording(times, cells, str(path))


def _of_text(text: str, name: str) -> VitalsRecording:
    titles, rows = _table(text)
    at = _time_column(titles, rows, name)
    unit_s = _time_unit(titles[at])
    times: list[float] = []
    values: list[list[float]] = [[] for _ in titles]
    for row in rows:
        time_s = _time_s(row[at], unit_s) if at < len(row) else math.nan
        if not math.isfinite(time_s):
            continue  # such as a second line of the header, with units
        times.append(time_s)
        for place, column in enumerate(values):
            column.append(_cell(row[place] if place < len(row) else ''))
    return _recording(times, [(title, title, column) for place, (title, column) in enumerate(
        zip(titles, values)) if place != at], name)


def _table(text: str) -> tuple[list[str], list[list[str]]]:
    """Return the titles and the rows of a CSV file; the delimiter is guessed."""
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith('#')]
    header = lines[0] if lines else ''
    delimiter = max(',;\t', key=header.count)
    rows = list(csv.reader(io.StringIO('\n'.join(lines)), delimiter=delimiter, quotechar='"'))
    titles = [title.strip(' \'"') for title in rows[0]] if rows else []
    return titles, rows[1:]


def _time_column(titles: Sequence[str], rows: Sequence[Sequence[str]], name: str) -> int:
    """Return the index of the column of times: of several the one with the most distinct ones."""
    at = max((place for place, title in enumerate(titles) if _time_unit(title)), default=None,
             key=lambda place: len({row[place] for row in rows if place < len(row)}))
    if at is None:
        raise ConfigError([f'{name!r} has no time column: name one minute, time_s, '
                           'timestamp, ...; its columns are ' + ', '.join(titles)[:200]])
    return at


def _recording(times: Sequence[float], cells: Sequence[tuple[str, str, list[float]]], name: str
               ) -> VitalsRecording:
    """
    Make a recording.

    :param times: of all rows, in s.
    :param cells: name, unit and values at these times of each column.
    """
    if not times:
        raise ConfigError([f'{name!r} contains no samples with a time'])
    order = sorted(range(len(times)), key=lambda place: times[place])
    first_s = times[order[0]]
    steps = [times[later] - times[earlier] for earlier, later in zip(order, order[1:])
             if times[later] > times[earlier]]
    period_s = round(median(steps), _DIGITS) if steps else 1.0
    found: list[Column] = []
    ignored = []
    for title, unit, values in cells:
        sign = sign_of(title)
        if not sign:
            ignored.append(title)
            continue
        samples = [(round(times[place] - first_s, _DIGITS), values[place]) for place in order
                   if place < len(values) and not math.isnan(values[place])]
        found.append(Column(title, sign, _in_unit(sign, unit, samples)))
    if not found:
        raise ConfigError([f'{name!r} has no column of a vital sign, such as HR, PULSE, RESP, '
                           f'SpO2, NBPSys; its columns are ' + ', '.join(
                               title for title, _, _ in cells)[:200]])
    signs = list(SIGNS)
    found.sort(key=lambda each: (signs.index(each.sign), COLUMNS[each.sign].index(
        _plain(each.name))))
    return VitalsRecording(found, ignored, len(times), period_s,
                           round(times[order[-1]] - first_s + period_s, _DIGITS))


def sign_of(title: str) -> str:
    """Return the sign of a column; empty for none."""
    plain = _plain(title)
    return next((sign for sign, names in COLUMNS.items() if plain in names), '')


def _plain(title: str) -> str:
    """Return a name in the form of the tables, without a unit in brackets."""
    return re.sub(r'[^a-z0-9]', '', re.sub(r'[(\[].*?[)\]]', '', title.lower()))


def _time_unit(title: str) -> float:
    """Return the unit of a time column in s; 0 if it is not one."""
    whole = re.sub(r'[^a-z0-9]', '', title.lower())
    return _TIMES_S.get(whole) or _TIMES_S.get(_plain(title), 0.0)


def _time_s(text: str, unit_s: float) -> float:
    text = text.strip(' \'"[]')
    try:
        return float(text) * unit_s
    except ValueError:
        pass
    if found := _CLOCK.fullmatch(text):
        return 3600.0 * float(found[1] or 0) + 60.0 * float(found[2]) + float(found[3])
    try:
        return datetime.fromisoformat(text.replace('Z', '+00:00')).timestamp()
    except ValueError:
        return math.nan


def _cell(text: str) -> float:
    """Return a number; NaN if the cell has none."""
    text = text.strip(' \'"').lower()
    try:
        # A comma within a cell is a decimal comma.
        return float(text.removesuffix('%').replace(',', '.'))
    except ValueError:
        return _MINDS.get(text, _WORDS.get(text, math.nan))


def _in_unit(sign: str, unit: str, samples: list[tuple[float, float]]
             ) -> list[tuple[float, float]]:
    """Convert samples to the unit of the sign, from degrees Fahrenheit or from a fraction."""
    values = [value for _, value in samples if value > 0.0]
    if not values:
        return samples
    if sign == 'body_temperature' and (
            re.search(r'(?i)\b(deg)?_?f(ahrenheit)?\b', unit) or median(
                values) > _FAHRENHEIT_FROM):
        return [(time_s, (value - 32.0) / 1.8 if value else value) for time_s, value in samples]
    if sign == 'spo2_percent' and max(values) <= 1.0:
        return [(time_s, 100.0 * value) for time_s, value in samples]
    return samples


def in_order(recording: VitalsRecording) -> Iterator[tuple[float, int, float]]:
    """Yield time in s, index of the column and value of all samples, in the order of time."""
    merged = [(time_s, place, value) for place, column in enumerate(recording.columns)
              for time_s, value in column.samples]
    yield from sorted(merged, key=lambda each: each[:2])
