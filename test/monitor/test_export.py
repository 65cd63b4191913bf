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

"""Charts and exports of observations, as a browser gets them; FHIR by other people's rules."""

from __future__ import annotations

from collections.abc import Iterator
import csv
import io
import json
from pathlib import Path
import time
from typing import Any

from households import confirm
import httpx
from monitor_server import logged_in
from monitor_server import quick_services
from monitor_server import served
import pytest
from rt_robot_os.monitor.security.roles import Role
from rt_robot_os.monitor.services import Services
from rt_robot_os.monitor.store.fhir import bundle

S = 1_000_000_000
#: Of a whole minute: what is a second apart is of the same.
NOW_NS = time.time_ns() // (60 * S) * 60 * S


def observation(seq: int, sign: str, value: float | None, ago_s: float, quality: str = 'good',
                person: str = 'anna', source: str = 'wrist') -> dict[str, Any]:
    return {'seq': seq, 'importance': 3, 'type': 'observation',
            'utc_ns': NOW_NS - round(ago_s * S), 'content': {
                'person': person, 'sign': sign, 'value': value, 'quality': quality,
                'source': source}}


RECORDS = [
    observation(0, 'pulse_per_min', 61.0, 600), observation(1, 'pulse_per_min', 63.5, 599),
    observation(2, 'pulse_per_min', None, 500, 'off'),
    observation(3, 'spo2_percent', 97.0, 400, 'suspect'),
    observation(4, 'systolic_mmhg', 121.0, 300, source='cuff'),
    observation(5, 'diastolic_mmhg', 79.0, 299.7, source='cuff'),
    observation(6, 'systolic_mmhg', 118.0, 200, source='cuff'),
    observation(7, 'body_temperature', 36.6, 190), observation(8, 'respiration_per_min', 14, 180),
    observation(9, 'consciousness', 0, 170, source='=HYPERLINK("x")'),
    observation(10, 'oxygen_l_per_min', 2.0, 160), observation(11, 'gait_speed', 0.8, 150),
    {**observation(12, '', 3, 140), 'type': 'news2'},
    observation(13, 'pulse_per_min', None, 130, 'missing'),
    observation(14, 'pulse_per_min', 62, 120, 'stale'),
    observation(15, 'pulse_per_min', 90.0, 110, person='ben', source='wrist_of_ben'),
    observation(16, 'pulse_per_min', 64.0, 100, source='bed_of_ben')]


@pytest.fixture
def services(tmp_path: Path) -> Services:
    made = quick_services(tmp_path)
    confirm(made.store, 'robot', 'anna', 'ben')
    made.store.hello('robot', 'b1')
    made.store.add('robot', 'b1', RECORDS)
    return made


@pytest.fixture
def address(services: Services) -> Iterator[str]:
    with served(services) as found:
        yield f'http://{found}/api/people'


def test_charts_and_exports_are_for_who_may_see_that_person(
        address: str, services: Services) -> None:
    headers = logged_in(services, 'vera', Role.VIEWER, ('anna',))
    within = f'start={NOW_NS - 3600 * S}&end={NOW_NS}'
    with httpx.Client(headers=headers) as page:
        found = page.get(f'{address}/anna/charts?sign=pulse_per_min&pixels=60&{within}').json()
        assert (found['low'], found['high'], found['count']) == ([61.0, 64.0], [63.5, 64.0],
                                                                 [2, 1])
        assert found['mean'][0] == pytest.approx(62.25)
        assert found['unit'] == '1/min'
        assert found['bucket_ns'] in (60 * S, 120 * S)
        table = list(csv.DictReader(io.StringIO(page.get(
            f'{address}/anna/export.csv?{within}').text)))
        assert [row['person'] for row in table] == ['anna'] * 16
        assert [(row['value'], row['unit'], row['quality'], row['loinc']) for row in table[:3]] \
            == [('61.0', '1/min', 'good', '8867-4'), ('63.5', '1/min', 'good', '8867-4'),
                ('', '1/min', 'off', '8867-4')]
        # No formula for a spreadsheet, and nobody else's name.
        assert {row['source'] for row in table} == {
            'wrist', 'cuff', '\'=HYPERLINK("x")', 'bed_of_(somebody)'}
        only = page.get(f'{address}/anna/export.csv?sign=spo2_percent&{within}')
        assert len(only.text.splitlines()) == 2
        assert only.headers['content-disposition'] == 'attachment; filename="anna.csv"'
        for path in ('charts?sign=pulse_per_min&', 'export.csv?', 'export.json?'):
            for person in ('ben', 'nobody'):
                assert page.get(f'{address}/{person}/{path}{within}').status_code == 404
        for wrong in ('start=5&end=5', 'start=-1&end=5', 'start=0&end=99999999999999999999',
                      'start=x&end=5', 'start=0'):
            answer = page.get(f'{address}/anna/charts?sign=pulse_per_min&{wrong}')
            assert answer.status_code == 422
            assert answer.json()['detail']['remedy']
    assert httpx.get(f'{address}/anna/export.csv').status_code == 401
    read = [(each['action'], each['object']) for each in services.audit.rows(limit=100)]
    assert read.count(('health.export', 'anna')) == 2
    assert ('health.export', 'ben') not in read


def _bundle(services: Services) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(''.join(bundle(
        'anna', services.store.observations('anna'), NOW_NS)))
    return found


def test_the_bundle_is_what_others_understand(address: str, services: Services) -> None:
    with httpx.Client(headers=logged_in(services)) as page:
        answer = page.get(f'{address}/anna/export.json')
    assert answer.headers['content-type'] == 'application/fhir+json'
    found = answer.json()
    assert len(found['entry']) == 1 + 16 - 1  # The person; the two pressures are one.
    _validate(found)
    observations = [each['resource'] for each in found['entry'][1:]]
    by_loinc = {each['code']['coding'][0]['code']: each for each in observations}
    assert {code: (each['valueQuantity']['code'], each['meta']['profile'][0].rpartition('/')[2])
            for code, each in by_loinc.items() if 'meta' in each and 'valueQuantity' in each} == {
                '8867-4': ('/min', 'heartrate'), '9279-1': ('/min', 'resprate'),
                '2708-6': ('%', 'oxygensat'), '8310-5': ('Cel', 'bodytemp')}
    assert by_loinc['2708-6']['status'] == 'preliminary'
    assert '59408-5' in {each['code'] for each in by_loinc['2708-6']['code']['coding']}
    assert by_loinc['88330-6']['valueQuantity'] == {
        'value': 3, 'unit': '{score}', 'system': 'http://unitsofmeasure.org', 'code': '{score}'}
    assert by_loinc['gait_speed']['code']['coding'][0]['system'].startswith(
        'https://rt-robot-os.example.org/')
    panels = [each for each in observations if each['code']['coding'][0]['code'] == '85354-9']
    assert [[(part['code']['coding'][0]['code'], part.get('valueQuantity', {}).get('value'))
             for part in each['component']] for each in panels] == [
        [('8480-6', 121.0), ('8462-4', 79.0)], [('8480-6', 118.0), ('8462-4', None)]]
    absent = [each['dataAbsentReason']['coding'][0]['code'] for each in observations
              if 'dataAbsentReason' in each]
    assert absent == ['not-performed', 'unknown', 'temp-unknown']


def _validate(found: dict[str, Any]) -> None:
    """Check what the profile needs and a library does not see; then let the library see."""
    ids = [each['fullUrl'] for each in found['entry']]
    assert len(set(ids)) == len(ids)
    for each in found['entry'][1:]:
        one = each['resource']
        assert one['status'] in ('final', 'preliminary')
        assert one['subject']['reference'] == ids[0]
        assert one['category'][0]['coding'][0]['code'] in ('vital-signs', 'survey', 'exam')
        for part in one.get('component', [one]):
            assert ('valueQuantity' in part) != ('dataAbsentReason' in part)
            assert all(coding['code'] for coding in part['code']['coding'])
    resources = pytest.importorskip('fhir.resources.R4B.bundle', reason='needs fhir.resources')
    resources.Bundle.model_validate(found)


def test_the_same_records_are_the_same_resources(services: Services) -> None:
    assert _bundle(services) == _bundle(services)


def test_an_export_that_nobody_reads_on_gives_its_place_back(
        address: str, services: Services) -> None:
    services.store.add('robot', 'b2', [
        observation(seq, 'pulse_per_min', 60.0, seq / 100) for seq in range(20_000)])
    with httpx.Client(headers=logged_in(services)) as page:
        for _ in range(6):
            with page.stream('GET', f'{address}/anna/export.json') as answer:
                next(answer.iter_raw())
        deadline = time.monotonic() + 30
        while page.get(f'{address}/anna/export.csv?end=1').status_code != 200:
            assert time.monotonic() < deadline
