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

"""The command `health falls` on recordings of volunteers, and on files as people write them."""

from __future__ import annotations

import gzip
import json
import math
from pathlib import Path
from typing import Any

import pytest

from rt_robot_os.features.health.cli.fall_evaluation import interval
from rt_robot_os.features.health.cli.fall_evaluation import rate_interval
from rt_robot_os.features.health.cli.program import main
from rt_robot_os.sim.world.body_motion import body_motion


def recording(head: str, scale: float = 1 / 9.80665, rate_hz: float = 25.0,
              activity: str = 'fall') -> list[str]:
    """Return the lines of one: four seconds of standing, then an activity."""
    lines = [f'@ {head}'] if head else []
    for number in range(round(12.0 * rate_hz)):
        at_s = number / rate_hz
        felt = (body_motion('walk', at_s) if at_s < 4.0 else
                body_motion(activity, at_s - 4.0, before='walk'))
        x, y, z = (each * scale for each in felt.force_m_s2)
        lines.append(f'{1000 * at_s:.0f},a,{x:.3f},{y:.3f},{z:.3f}')
        rates = (math.degrees(each) for each in felt.rate_rad_s)
        lines.append(f'{1000 * at_s:.0f},w,' + ','.join(f'{each:.1f}' for each in rates))
    return lines


@pytest.fixture
def falls(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Any:
    """Return what evaluates lines or bytes: the exit code and the object, or what was told."""
    def run(content: list[str] | bytes, *options: str) -> tuple[int, Any]:
        path = tmp_path / 'recordings.csv'
        path.write_bytes(content if isinstance(content, bytes) else
                         '\n'.join(content).encode())
        code = main(['falls', str(path), '--json', *options])
        out, err = capsys.readouterr()
        return code, json.loads(out) if out else err
    return run


def test_the_bar_holds_on_falls_of_volunteers(
        data_dir: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = data_dir / 'falls' / 'umafall_waist_20hz.csv.gz'
    assert main(['falls', str(path), '--json']) == 0
    found = json.loads(capsys.readouterr().out)
    assert found['sensitivity']['of'] == 46 and found['specificity']['of'] == 53
    assert found['sensitivity']['share'] >= 0.97 and found['specificity']['share'] >= 0.97
    assert found['lying_down_on_purpose']['recordings'] == 2
    assert 0.0 < found['after_impact_s']['worst'] <= 5.0
    for one in found['recordings']:
        assert one['detected'] or one['after_impact_s'] is None


def test_metres_per_second_squared_gyroscopes_and_other_sensors_are_read(falls: Any) -> None:
    lines = recording('one,1,soft,7', scale=1.0)
    lines[5:5] = ['80,m,1,2,3', 'nonsense', '81,a,1', '82,a,nan,0,0', '# a comment', '']
    code, found = falls(gzip.compress('\n'.join(lines).encode()))
    one, = found['recordings']
    assert (code, one['detected'], one['in_m_s2']) == (0, True, True)
    assert (one['bad_rows'], one['other_sensors_rows']) == (3, 1)
    assert one['subject'] == '7' and one['movement'] == 'soft'
    assert 4.0 < one['impact_ms'] / 1000 < 5.5 and 0 < one['after_impact_s'] < 5
    assert abs(one['after_peak_s'] - one['after_impact_s']) < 0.3
    assert one['detected_ms'] - one['impact_ms'] == pytest.approx(1000 * one['after_impact_s'])


def test_what_is_counted_is_what_the_files_say(falls: Any) -> None:
    lines = [line for head, activity in (
        ('a,1,front,1', 'fall'), ('b,0,chair,1', 'sit'), ('c,1,none,2', 'sit'),
        ('d,0,odd,2', 'fall'), ('e,0,LyingDown_OnABed,2', 'fall'), ('f,0,D13,3', 'lie'),
        ('g', 'fall'))
        for line in recording(head, activity=activity)]
    _, found = falls(lines)
    assert found['confusion'] == {'falls_found': 1, 'falls_missed': 1, 'daily_quiet': 1,
                                  'daily_alarms': 1}
    assert found['lying_down_on_purpose'] == {'recordings': 2, 'alarms': 1}
    assert found['movements']['none'] == {'recordings': 1, 'detected': 0, 'fall': True}
    assert [one['right'] for one in found['recordings']] == [
        True, True, False, False, False, True, None]
    _, found = falls(lines, '--lying', 'odd')
    assert found['lying_down_on_purpose'] == {'recordings': 1, 'alarms': 1}
    code, told = falls(lines, '--lying', 'nosuch')
    assert code == 2 and "--lying 'nosuch' matches nothing; there are: " in told
    assert 'odd' in told


def test_each_subject_is_decided_with_limits_of_the_others(falls: Any) -> None:
    lines = [line for subject in (1, 2, 3) for head, activity in (
        (f'a,1,front,{subject}', 'fall'), (f'b,0,chair,{subject}', 'sit'))
        for line in recording(head, activity=activity)]
    _, found = falls(lines, '--cross-validate')
    validated = found['cross_validation']
    assert sorted(validated['chosen']) == ['1', '2', '3']
    # All rows do as well here: the limits as they are stay.
    assert all(one['evidence'] == found['limits']['evidence']
               for one in validated['chosen'].values())
    assert validated['sensitivity']['right'] == validated['sensitivity']['of'] == 3


def test_a_recording_without_a_head_or_without_rows_is_said(falls: Any) -> None:
    code, found = falls(recording(''))
    assert code == 0 and found['recordings'][0]['detected']
    assert found['sensitivity']['share'] is None and found['recordings'][0]['right'] is None
    code, found = falls(['@ empty,1,front,1', '5,m,1,2,3'])
    assert code == 1 and 'no accelerometer row' in found['recordings'][0]['problem']
    assert found['sensitivity']['of'] == 0


@pytest.mark.parametrize('content', [
    b'', b'# only a comment\n', b'\xff\xfe\x00 no text',
    gzip.compress(b'@ a,1,b,c\n' * 99, mtime=0)[:-9]])
def test_a_file_that_is_none_is_named(falls: Any, content: bytes) -> None:
    code, told = falls(content)
    assert code == 2 and 'recordings.csv' in told


@pytest.mark.parametrize(('option', 'named'), [
    ('evidence', 'evidence must be a number'), ('evidence=9', 'from 0.1 to 4'),
    ('peak_g=3', "unknown limit 'peak_g'"), ('stop_from_m_s=4', 'must be below stop_full_m_s')])
def test_a_limit_that_cannot_be_is_refused_by_name(falls: Any, option: str, named: str) -> None:
    code, told = falls(recording('a,1,b,c'), '--set', option)
    assert code == 2 and named in told


def test_limits_can_be_set(falls: Any) -> None:
    _, found = falls(recording('a,1,b,c'), '--set', 'evidence=2.5', '--set', 'stop_full_m_s=9')
    assert found['limits']['evidence'] == 2.5 and not found['recordings'][0]['detected']


def test_the_text_names_what_went_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]
                                        ) -> None:
    path = tmp_path / 'some.csv'
    path.write_text('\n'.join(recording('a,1,front,1') + recording('b,1,slow,1', activity='lie')))
    assert main(['falls', str(path), '--cross-validate']) == 0
    out = capsys.readouterr().out
    assert 'MISSED   b: no fall' in out and 'right    a: fall, ' in out
    assert 'sensitivity 0.500 (1 of 2; 95 %: ' in out and 'chosen on the others' in out


def test_the_interval_is_wilsons() -> None:
    assert interval(45, 46) == pytest.approx((0.8866, 0.9962), abs=1e-3)
    assert interval(0, 0) == (0.0, 1.0) and interval(10, 10)[1] == pytest.approx(1.0)


def test_every_false_alarm_counts_per_hour_of_wear(falls: Any) -> None:
    """Two falls in one recording that is said to hold none, then an hour that was not recorded."""
    lines = recording('a,0,day,1')
    shift_ms = 3_600_000
    for line in recording('', activity='rise') + recording(''):
        time, rest = line.split(',', 1)
        lines.append(f'{int(time) + shift_ms},{rest}')
        if time == '11960' and rest.startswith('w'):
            shift_ms += 12_000
    _, found = falls(lines + recording('b,1,front,1'))
    alarms = found['false_alarms']
    assert alarms['alarms'] == found['recordings'][0]['falls'] == 2
    assert alarms['hours'] == pytest.approx(3 * 12 / 3600, abs=0.2 / 3600)
    assert alarms['per_hour'] == pytest.approx(2 / alarms['hours'])
    # Of two events: 0.242 to 7.225 (Garwood 1936).
    assert rate_interval(2, 1.0) == pytest.approx((0.2422, 7.2247), abs=1e-3)
    assert rate_interval(0, 2.0) == pytest.approx((0.0, 3.6889 / 2), abs=1e-3)
