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

"""Alarms over kills, lost networks and full disks; and that the rehearsal would notice a loss."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from broad import examples
import pytest

from rt_robot_os.features.alarms.alarm_service import AlarmService
from rt_robot_os.features.alarms.cli.command import run
from rt_robot_os.features.alarms.journal_lines import encode_header
from rt_robot_os.features.alarms.journal_lines import encode_record
from rt_robot_os.features.alarms.journal_lines import JournalHeader
from rt_robot_os.features.alarms.notifier.delivery_log import DeliveryLog
from rt_robot_os.features.alarms.scenarios import notifier_process
from rt_robot_os.features.alarms.scenarios.rehearsal import rehearse

ALARMS = min(examples(80), 10_000)


def test_each_emergency_ends_with_somebody_or_at_the_top() -> None:
    found = rehearse(ALARMS, seed=1)
    assert (found.lost, found.shown_twice, found.scenes_lost) == (0, 0, [])
    assert found.alarms == ALARMS == found.acknowledged + found.top
    assert found.acknowledged > ALARMS / 2 and found.top and found.shown > ALARMS
    assert all(found.went_wrong[what] for what in (
        'core_killed', 'journal_killed', 'notifier_killed', 'power_killed', 'full_disks',
        'outages', 'reports_lost'))


def test_the_same_seed_is_the_same_run(capsys: pytest.CaptureFixture[str]) -> None:
    said = []
    for seed in ('3', '3', '4'):
        assert run(['rehearse', '--alarms', '6', '--seed', seed, '--json']) == 0
        said.append(capsys.readouterr().out)
    assert said[0] == said[1] != said[2]
    assert json.loads(said[0])['passed'] is True
    assert run(['rehearse', '--alarms', '2']) == 0
    assert '2 emergencies' in capsys.readouterr().out
    assert run(['rehearse', '--alarms', '0']) == 2


def test_a_notifier_that_forgets_would_be_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(DeliveryLog, 'restore', lambda self, lines: None)
    monkeypatch.setattr(notifier_process, 'is_doubtful', lambda *arguments: False)
    assert rehearse(40, seed=1).shown_twice


def test_a_desk_that_forgets_would_be_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(AlarmService, '_take_record', lambda *arguments: None)
    found = rehearse(20, seed=1)
    assert found.told_anew or found.lost


# ---- the journal, shown ----------------------------------------------------------------------

def journal(path: Path) -> bytes:
    def record(seq: int, event: str, state: Any) -> bytes:
        return encode_record(json.dumps({
            'seq': seq, 't_ns': 10 ** 9, 'alarm': '7', 'state': state, 'events': [
                {'t_ns': 10 ** 9, 'alarm': '7', 'event': event, 'level': 'urgent',
                 'subject': 'anna', 'kinds': ['fall'], 'by': 'mary\x1b[2J'}]}), 10 ** 18)

    data = encode_header(JournalHeader(3, 0)) + record(1, 'raised', {'id': '7'})
    path.write_bytes(data)
    return data


def test_a_journal_is_shown_as_far_as_it_is_whole(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / 'alarms.journal'
    data = journal(path)
    assert run(['journal', str(tmp_path)]) == 0
    event, count = capsys.readouterr().out.splitlines()
    assert 'raised' in event and 'anna: fall by mary' in event and '\x1b' not in event
    assert count == '1 records, 1 alarms open'
    path.write_bytes(data + data[-30:])
    assert run(['journal', str(path), '--json']) == 0
    found = json.loads(capsys.readouterr().out)
    assert found['torn_bytes'] == 30 and found['open'] == [{'id': '7'}]
    assert [each['seq'] for each in found['records']] == [1]


@pytest.mark.parametrize('name', ['', 'nobody'])
def test_where_no_journal_is_it_says_so(
        tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(['journal', str(tmp_path / name)]) == 2
    assert str(tmp_path / name) in capsys.readouterr().err
