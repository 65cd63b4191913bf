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
Observations as FHIR R4: a bundle of the person and the measurements, by the vital signs profile.

It is a format for export, not for storage. A missing value has a reason (``dataAbsentReason``); a
value that two sensors contradict is ``preliminary``. Systolic and diastolic pressure of one
measurement are the components of one panel. A sign without a LOINC code has one of
:data:`~rt_robot_os.monitor.store.codes.LOCAL`.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Iterator
from collections.abc import Mapping
from datetime import datetime
from datetime import timezone
import json
from typing import Any
from typing import Final
from uuid import UUID
from uuid import uuid5

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.monitor.store.codes import code_of
from rt_robot_os.monitor.store.codes import DIASTOLIC
from rt_robot_os.monitor.store.codes import LOCAL
from rt_robot_os.monitor.store.codes import LOINC
from rt_robot_os.monitor.store.codes import PRESSURE
from rt_robot_os.monitor.store.codes import SignCode
from rt_robot_os.monitor.store.codes import SYSTOLIC
from rt_robot_os.monitor.store.codes import UCUM

#: Longest time between systolic and diastolic pressure of one measurement.
TOGETHER_NS: Final = NS_PER_S
_PROFILES: Final = 'http://hl7.org/fhir/StructureDefinition/'
_CATEGORIES: Final = 'http://terminology.hl7.org/CodeSystem/observation-category'
_ABSENT: Final = 'http://terminology.hl7.org/CodeSystem/data-absent-reason'
_PEOPLE: Final = 'https://rt-robot-os.example.org/fhir/person'
#: Reason for a missing value, by quality.
_REASONS: Final = {'off': 'not-performed', 'missing': 'unknown', 'stale': 'temp-unknown'}
_NAMESPACE: Final = UUID('5f0b4d39-9d8e-4c55-8c0e-3b6a1f3c0f5e')
_PRESSURES: Final = frozenset({SYSTOLIC, DIASTOLIC})

Row = Mapping[str, Any]


def bundle(person: str, rows: Iterable[Row], now_ns: int) -> Iterator[str]:
    """
    Yield a bundle in pieces.

    :param rows: observations of this person, as ``Store.observations`` gives them, in order of
        time.
    :param now_ns: UTC.
    :return: strings that together are one JSON document.
    """
    yield ('{"resourceType":"Bundle","type":"collection","timestamp":"' + instant(now_ns)
           + '","entry":[')
    subject = f'urn:uuid:{uuid5(_NAMESPACE, person)}'
    yield _entry(subject, patient(person))
    for found in _grouped(rows):
        one = observation(found, subject)
        yield ',' + _entry(f'urn:uuid:{one["id"]}', one)
    yield ']}'


def instant(t_ns: int) -> str:
    """Return a time in the format of FHIR: UTC, to the millisecond."""
    found = datetime.fromtimestamp(t_ns // NS_PER_S, timezone.utc)
    return f'{found:%Y-%m-%dT%H:%M:%S}.{t_ns % NS_PER_S // 1_000_000:03d}Z'


def patient(person: str) -> dict[str, Any]:
    """Return the patient: a pseudonym and nothing else."""
    return {'resourceType': 'Patient', 'id': str(uuid5(_NAMESPACE, person)),
            'identifier': [{'use': 'secondary', 'system': _PEOPLE, 'value': person}]}


def observation(rows: tuple[Row, ...], subject: str) -> dict[str, Any]:
    """
    Return a measurement: one value, or the two of a blood pressure.

    :param subject: reference to the person.
    """
    first = rows[0]
    is_pressure = first['code'] in _PRESSURES
    code = PRESSURE if is_pressure else code_of(first['code'])
    made: dict[str, Any] = {
        'resourceType': 'Observation', 'id': _id(first),
        'status': 'preliminary' if any(each['quality'] == 'suspect' for each in rows) else 'final',
        'category': [{'coding': [_category(first['code'], code)]}],
        'code': _concept(code, '' if is_pressure else first['code']),
        'subject': {'reference': subject}, 'effectiveDateTime': instant(first['t_ns']),
        'issued': instant(first['arrived_ns'])}
    if code.profile:
        made['meta'] = {'profile': [_PROFILES + code.profile]}
    if first['source']:
        made['device'] = {'display': first['source']}
    if is_pressure:
        made['component'] = [_component(sign, rows) for sign in (SYSTOLIC, DIASTOLIC)]
    else:
        made.update(_value(first, code))
    notes = sorted({each['quality'] for each in rows} - {'good'})
    if notes:
        made['note'] = [{'text': f'quality: {", ".join(notes)}'}]
    return made


def _grouped(rows: Iterable[Row]) -> Iterator[tuple[Row, ...]]:
    """Yield rows one by one, the two pressures of a measurement together."""
    waiting: list[Row] = []
    for row in rows:
        while waiting and row['t_ns'] - waiting[0]['t_ns'] > TOGETHER_NS:
            yield (waiting.pop(0),)
        if row['code'] not in _PRESSURES:
            yield (row,)
            continue
        other = next((each for each in waiting if each['code'] != row['code']
                      and each['robot'] == row['robot'] and each['source'] == row['source']), None)
        if other is None:
            waiting.append(row)
        else:
            waiting.remove(other)
            yield (other, row)
    for row in waiting:
        yield (row,)


def _component(sign: str, rows: tuple[Row, ...]) -> dict[str, Any]:
    code = code_of(sign)
    row = next((each for each in rows if each['code'] == sign), None)
    return {'code': _concept(code, sign), **(_absent('unknown') if row is None
                                             else _value(row, code))}


def _value(row: Row, code: SignCode) -> dict[str, Any]:
    if row['value'] is None or row['quality'] in _REASONS:
        return _absent(_REASONS.get(row['quality'], 'unknown'))
    quantity = {'value': row['value'], 'unit': code.unit or code.ucum}
    if code.ucum:
        quantity.update(system=UCUM, code=code.ucum)
    return {'valueQuantity': quantity}


def _absent(reason: str) -> dict[str, Any]:
    return {'dataAbsentReason': {'coding': [{'system': _ABSENT, 'code': reason}]}}


def _concept(code: SignCode, sign: str) -> dict[str, Any]:
    coding = [{'system': code.system, 'code': code.code, 'display': code.title}]
    coding += [{'system': LOINC, 'code': each} for each in code.more]
    if sign and code.system != LOCAL:
        coding.append({'system': LOCAL, 'code': sign})
    return {'coding': coding, 'text': code.title}


def _category(sign: str, code: SignCode) -> dict[str, str]:
    kind = 'vital-signs' if code.profile else 'survey' if sign == 'news2' else 'exam'
    return {'system': _CATEGORIES, 'code': kind}


def _id(row: Row) -> str:
    return str(uuid5(_NAMESPACE, f'{row["robot"]}/{row["boot"]}/{row["seq"]}'))


def _entry(url: str, resource: dict[str, Any]) -> str:
    return json.dumps({'fullUrl': url, 'resource': resource}, ensure_ascii=False, allow_nan=False,
                      separators=(',', ':'))
