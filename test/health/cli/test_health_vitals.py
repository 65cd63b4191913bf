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

"""The command `health vitals` on a recorded monitor, and on files as others write them."""

from __future__ import annotations

import gzip
import json
from pathlib import Path
import struct
from typing import Any

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest
from rt_robot_os.features.health.cli.program import main
from rt_robot_os.features.health.cli.vitals_file import _of_text
from rt_robot_os.features.health.cli.vitals_file import VitalsRecording
from rt_robot_os.features.health.cli.vitals_report import EvaluationOptions
from rt_robot_os.features.health.cli.vitals_report import report
from rt_robot_os.features.health.cli.vitals_run import play

RECORD = 's25047-2704-05-04-10-44n'


def evaluated(text: str, **assessment: Any) -> dict[str, Any]:
    """Return the report of the text of a file."""
    recording = _of_text(text, 'test.csv')
    return report('test.csv', recording, play(recording, {}, assessment), EvaluationOptions(
        [], 1, None, False))


def minutes(**columns: list[float | str]) -> str:
    """Return a file with a row a minute."""
    rows = zip(*columns.values(), strict=True)
    return '\n'.join([','.join(('minute', *columns)), *(
        f'{place},' + ','.join(map(str, row)) for place, row in enumerate(rows))])


@pytest.fixture
def vitals(capsys: pytest.CaptureFixture[str]) -> Any:
    """Return what runs the command: the exit code and the object that it wrote."""
    def run(*arguments: str) -> tuple[int, dict[str, Any]]:
        code = main(['vitals', *arguments, '--json'])
        out = capsys.readouterr().out
        return code, json.loads(out) if out else {}
    return run


def test_a_recorded_monitor_with_its_sensor_off_zeros(data_dir: Path, vitals: Any) -> None:
    code, found = vitals(str(data_dir / 'vitals' / f'{RECORD}.csv'))
    assert code == 0
    file, = found['files']
    # HR is 0 from minute 45 on, PULSE and SpO2 at the beginning: no heart stands still.
    assert not [each for each in file['clinical_alarms'] if 'pulse' in each['kind']]
    assert {each['kind'] for each in file['clinical_alarms']} == {'news2'}
    assert found['false_alarms'] == 0 and found['clinical_alarms'] == 2
    off = [(each['subject'], each['start_s']) for each in file['technical_alarms']
           if each['kind'] == 'sensor_off']
    assert off[:3] == [('PULSE', 60.0), ('SpO2', 60.0), ('HR', 2760.0)]
    assert file['news2']['complete_s'] == 0.0 and file['news2']['highest_total'] is None
    assert file['signs']['spo2_percent']['missing_s'] == 60.0
    assert sum(file['signs']['spo2_percent'].values()) == pytest.approx(72 * 60.0)
    assert file['ignored_columns'] == ['NBPMean']


def test_the_record_itself_says_the_same_as_its_csv(data_dir: Path, vitals: Any) -> None:
    where = data_dir / 'vitals' / RECORD
    _, by_text = vitals(f'{where}.csv')
    _, by_record = vitals(f'{where}.hea')
    for file in (by_text['files'][0], by_record['files'][0]):
        del file['file'], file['ignored_columns']
    assert by_record == by_text


def test_zeros_alone_give_no_clinical_alarm_and_a_technical_one_after_a_minute() -> None:
    zeros: list[float | str] = [0] * 30
    found = evaluated(minutes(HR=zeros, PULSE=zeros, RESP=zeros, SpO2=zeros, NBPSys=zeros,
                              Temp=zeros), limits=[
        'pulse_per_min < 50', 'spo2_percent < 90', 'systolic_mmhg < 90',
        'respiration_per_min < 8'])
    assert not found['clinical_alarms']
    assert {(each['kind'], each['start_s']) for each in found['technical_alarms']} == {
        ('sensor_off', 60.0)}
    assert all(each['good_s'] == 0.0 for each in found['signs'].values())


@settings(max_examples=10)
@given(st.lists(st.sampled_from([0.0, 72.0, -1.0, 400.0]), min_size=3, max_size=12),
       st.lists(st.sampled_from([0.0, 97.0, 127.0]), min_size=3, max_size=12))
def test_a_person_who_is_well_has_no_clinical_alarm_however_sensors_come_and_go(
        pulse: list[float], spo2: list[float]) -> None:
    rows = min(len(pulse), len(spo2))
    found = evaluated(minutes(HR=list(pulse[:rows]), SpO2=list(spo2[:rows])), limits=[
        'pulse_per_min < 50', 'pulse_per_min > 120', 'spo2_percent < 92'])
    assert not found['clinical_alarms']


ROWS = [(0, 70.0, 97.0), (1, 71.0, 96.0), (2, 72.0, 96.0), (3, 70.0, 97.0)]


@pytest.mark.parametrize('text', [
    'SpO2,PULSE,minute\n' + '\n'.join(f'{s},{p},{t}' for t, p, s in ROWS),
    'time_s;Heart Rate (bpm);SpO2 [%]\n' + '\n'.join(f'{60 * t};{p};{s}' for t, p, s in ROWS),
    'Elapsed time\tPR\t%SpO2\nhh:mm:ss\tbpm\t%\n' + '\n'.join(
        f'00:{t:02}:00\t{p}\t{s}' for t, p, s in ROWS),
    'timestamp,hr,sats,comment\n' + '\n'.join(
        f'2020-01-01T08:{t:02}:00Z,{p},{s},fine' for t, p, s in ROWS),
    "'Time (min)','HR','SpO2','Resp'\n" + '\n'.join(
        f"{t},{p},{s},{('-', '', 'NaN', 'nan')[t]}" for t, p, s in ROWS),
    'date,time,hr,spo2\n' + '\n'.join(
        f'2020-01-01,08:{t:02}:00,{p},{s:g}%' for t, p, s in ROWS),
    'Minute;PULSE;SpO2\n' + '\n'.join(
        f'{t};{str(p).replace(".", ",")};{s:g}' for t, p, s in ROWS),
    '# of a monitor\n\nt_ms,hr,spo2\n' + '\n'.join(
        f'{60_000 * t},{p},{s / 100}' for t, p, s in reversed(ROWS))])
def test_files_as_others_write_them(text: str) -> None:
    recording = _of_text(text, 'test.csv')
    samples = {column.sign: column.samples for column in recording.columns if column.samples}
    assert samples == {'pulse_per_min': [(60.0 * t, p) for t, p, _ in ROWS],
                       'spo2_percent': [(60.0 * t, pytest.approx(s)) for t, _, s in ROWS]}
    assert (recording.period_s, recording.length_s) == (60.0, 240.0)


def test_a_gzipped_file_and_one_that_is_cut_short(tmp_path: Path, vitals: Any) -> None:
    path = tmp_path / 'night.csv.gz'
    path.write_bytes(gzip.compress(minutes(HR=[70] * 5).encode()))
    code, found = vitals(str(path))
    assert code == 0 and found['files'][0]['rows'] == 5
    path.write_bytes(path.read_bytes()[:-12])
    assert vitals(str(path))[0] == 2


def test_temperatures_in_fahrenheit_and_the_consciousness_of_a_chart() -> None:
    recording = _of_text(minutes(Temp=[98.6, 0, 98.6], ACVPU=['A', 'V', 'unresponsive'],
                                 O2=['air', 'air', 2]), 'test.csv')
    columns = {column.sign: [value for _, value in column.samples]
               for column in recording.columns}
    assert columns['body_temperature'] == [pytest.approx(37.0), 0.0, pytest.approx(37.0)]
    assert columns['consciousness'] == [0.0, 2.0, 4.0]
    assert columns['oxygen_l_per_min'] == [0.0, 0.0, 2.0]


def test_a_complete_set_is_scored_and_its_course_is_written() -> None:
    rows = 10
    found = evaluated(minutes(
        HR=[70] * rows, RESP=[18] * rows, SpO2=[97] * 5 + [90] * 5, SBP=[120] + [''] * 9,
        Temp=[36.8] + [''] * 9, ACVPU=['A'] + [''] * 9, O2=['air'] + [''] * 9))
    assert found['news2']['complete_s'] == 600.0
    assert [(each['time_s'], each['total']) for each in found['news2']['course']
            if each['complete']] == [(0.0, 0), (300.0, 3)]
    alarm, = found['clinical_alarms']
    assert (alarm['level'], alarm['start_s'], alarm['end_s']) == ('urgent', 360.0, None)
    assert alarm['false'] is False


def test_who_was_well_had_false_alarms(tmp_path: Path, vitals: Any) -> None:
    path = tmp_path / 'well.csv'
    path.write_text(minutes(HR=[70] * 5 + [150] * 20))
    limit = ['--limit', 'pulse_per_min > 120 for 2 min level urgent']
    _, found = vitals(str(path), *limit)
    assert (found['clinical_alarms'], found['false_alarms']) == (2, 0)
    _, found = vitals(str(path), '--well', *limit)
    assert found['false_alarms'] == 2
    assert found['false_alarms_per_person_day'] == pytest.approx(2 / (25 / 1440))


def test_a_record_of_numerics_of_others(tmp_path: Path, vitals: Any) -> None:
    values = [(720, 970), (0, 0), (-32768, 965)] * 5
    (tmp_path / 'one.dat').write_bytes(b''.join(struct.pack('<2h', *row) for row in values))
    (tmp_path / 'one.hea').write_text(
        'one 2 1 15\none.dat 16 10/bpm 16 0 0\none.dat 16 10/% 16 0\n')
    code, _ = vitals(str(tmp_path / 'one.hea'))
    assert code == 2, 'without names nobody knows what is what'
    (tmp_path / 'one.hea').write_text('one 2 1 15\none.dat 16 10/bpm 16 0 720 %d 0 HR\n'
                                      'one.dat 16 10/%% 16 0 970 %d 0 SpO2\n' % tuple(
                                          sum(column) & 0xFFFF for column in zip(*values)))
    code, found = vitals(str(tmp_path / 'one.hea'))
    assert code == 0
    sensors = {each['column']: each for each in found['files'][0]['sensors']}
    assert (sensors['HR']['readings'], sensors['HR']['said_off']) == (10, 5)
    assert sensors['SpO2']['readings'] == 15


@pytest.mark.parametrize('text, words', [
    ('', 'no time column'), ('HR,SpO2\n70,97', 'no time column'),
    ('minute,weight\n1,70', 'no column of a vital sign'), ('minute,HR\nx,y', 'no samples')])
def test_a_file_that_says_nothing_is_refused(
        text: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / 'bad.csv'
    path.write_text(text)
    assert main(['vitals', str(path)]) == 2
    assert words in capsys.readouterr().err
    assert main(['vitals', str(tmp_path / 'none.csv')]) == 2
    assert main(['vitals', str(path), '--limit', 'puls > 3']) == 2


def test_the_text_for_people(data_dir: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['vitals', str(data_dir / 'vitals' / f'{RECORD}.csv')]) == 0
    out = capsys.readouterr().out
    assert 'pulse_per_min (HR PULSE): good' in out
    assert 'for each person and day 40.0 clinical alarms, of these 0.0 false' in out


def test_columns_may_be_many_and_strange() -> None:
    recording = _of_text('time,HR,HR,hr (bpm),12 lead\n0,70,71,72,1\n1,70,71,72,1', 'test.csv')
    assert isinstance(recording, VitalsRecording)
    found = report('x', recording, play(recording, {}, {}), EvaluationOptions([], 1, None, False))
    assert found['signs']['pulse_per_min']['good_s'] == 2.0
    assert [each['readings'] for each in found['sensors']] == [2, 2, 2]
    assert [column.samples[0][1] for column in recording.columns] == [70.0, 71.0, 72.0]
