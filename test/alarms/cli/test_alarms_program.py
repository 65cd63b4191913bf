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

"""The program `alarms` as its user meets it: lists, answers, refusals, no robot at all."""

from __future__ import annotations

import json
from pathlib import Path
import threading
from typing import Any

from processes import wait_until
import pytest

from rt_robot_os.base.errors import LinkError
from rt_robot_os.features.alarms.cli.command import run
from rt_robot_os.features.alarms.cli.table import duration
from rt_robot_os.features.alarms.cli.watching import watch

ALARM = {'level': 2, 'name': 'alarm 7: anna', 'hardware_id': 'anna',
         'message': 'raised: fall, help: she fell in the bathroom',
         'values': {'id': '7', 'state': 'raised', 'level': 'critical', 'subject': 'anna',
                    'kinds': 'fall help', 'age_s': '150', 'told': 'operator', 'failed': 'family'}}
PATIENT = ('--timeout', '60')


def answer(command: str) -> dict[str, Any]:
    ok = 'acknowledge 8' not in command
    return {'command': command[:100], 'ok': ok, 'alarm': '7',
            'text': '7 (anna) is acknowledged' if ok else "no open alarm is called '8'"}


def test_the_open_alarms_are_a_table_or_json(
        core: Any, capsys: pytest.CaptureFixture[str]) -> None:
    core.publish('alarms/list', {'status': [ALARM, {'level': 2, 'message': '3 more'}]})
    assert run(['list']) == 0
    head, row, note = capsys.readouterr().out.splitlines()
    assert head.split() == ['ID', 'LEVEL', 'STATE', 'OPEN', 'FOR', 'WHO', 'WHAT', 'TOLD']
    assert row.split() == ['7', 'critical', 'raised', '2', 'min', 'anna', 'fall,', 'help',
                           'operator', '(not', 'family)']
    assert note == '3 more'
    assert run(['list', '--json']) == 0
    found = json.loads(capsys.readouterr().out)
    assert found == {'alarms': [{**ALARM['values'], 'message': ALARM['message'],  # type: ignore
                                 'severity': 2}], 'notes': ['3 more']}
    core.publish('alarms/list', {'status': [{'level': 0, 'name': 'alarms',
                                             'message': 'no alarm'}]})
    wait_until(lambda: run(['list']) == 0 and 'no alarm is open' in capsys.readouterr().out,
               'an empty list')


@pytest.mark.parametrize(('arguments', 'command'), [
    (['acknowledge', '7', '--by', 'mary'], 'acknowledge 7 by mary'),
    (['acknowledge', 'all', 'we', 'are', 'there', '--by', 'mary k'],
     'acknowledge all by mary_k we are there'),
    (['resolve', 'anna', '--by', 'mary'], 'resolve anna by mary'),
    (['cancel', '7', '--by', 'mary', 'she', 'sat down'], 'cancel 7 by mary she sat down'),
    (['confirm', '7', '--by', 'mary', 'x' * 150], 'confirm 7 by mary ' + 'x' * 150),
    (['escalate', '7', '--by', 'mary'], 'escalate 7 by mary'),
    (['test', 'urgent', '--by', 'mary'], 'test urgent by mary'),
    (['test', '--by', 'mary'], 'test technical by mary'),
    (['silence', '30', '--by', 'mary'], 'silence 30 by mary')])
def test_what_is_ordered_is_said_in_plain_words_and_its_answer_printed(
        core: Any, arguments: list[str], command: str, capsys: pytest.CaptureFixture[str]) -> None:
    core.answers = answer
    assert run([*arguments, *PATIENT]) == 0
    assert core.heard['alarms/command'] == [command]
    assert capsys.readouterr().out == '7 (anna) is acknowledged\n'


def test_a_refusal_is_told_and_is_the_exit_code(
        core: Any, capsys: pytest.CaptureFixture[str]) -> None:
    core.answers = answer
    assert run(['acknowledge', '8', '--by', 'mary', *PATIENT]) == 1
    assert capsys.readouterr() == ('', "alarms: no open alarm is called '8'\n")
    assert run(['acknowledge', '8', '--by', 'mary', '--json', *PATIENT]) == 1
    assert json.loads(capsys.readouterr().out)['ok'] is False


def test_without_an_answer_it_says_what_may_have_happened(core: Any) -> None:
    with pytest.raises(LinkError, match="did not answer 'test technical by mary' within 0.05 s; "
                                        'the outcome is unknown'):
        run(['test', '--by', 'mary', '--timeout', '0.05'])


def test_without_anything_that_keeps_alarms_nothing_is_ordered(core: Any) -> None:
    core.client.request('unmirror', topic='alarms/command')
    with pytest.raises(LinkError, match='nothing that answers on alarms/answer is connected'):
        run(['test', '--by', 'mary', *PATIENT])


def test_without_a_robot_it_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('RT_ROBOT_OS_RUNTIME_DIR', str(tmp_path))
    for arguments in (['list'], ['watch'], ['acknowledge', '7']):
        with pytest.raises(LinkError, match='is the robot running.* No robot of this user runs'):
            run(arguments)


def test_events_are_followed_from_one_core_to_the_next(
        core: Any, capsys: pytest.CaptureFixture[str]) -> None:
    ended = threading.Event()
    said: list[str] = []
    thread = threading.Thread(target=watch, args=(core.folder / 'robot.sock', False,
                                                  ended.is_set))

    def happen(event: str) -> None:
        core.publish('alarms/events', {
            'seq': 1, 't_ns': 5, 'alarm': '7', 'event': event, 'state': event, 'by': 'mary',
            'level': 'critical', 'subject': 'anna', 'kinds': ['fall'], 'why': 'we are there'})

    def printed(event: str) -> bool:
        said.append(capsys.readouterr().out)
        return event in ''.join(said)

    def watched() -> bool:
        return any(each['name'] == 'alarms' and each['mirrors']
                   for each in core.client.statistics().clients)

    thread.start()
    try:
        wait_until(watched, 'the mirror')
        happen('acknowledged')
        wait_until(lambda: printed('acknowledged'), 'a line')
        assert 'anna: fall by mary (we are there)' in ''.join(said)
        core.publish('alarms/events', 'no JSON')
        wait_until(lambda: printed('unreadable'), 'a line')
        core.kill()
        core.start()
        wait_until(watched, 'the mirror')
        happen('resolved')
        wait_until(lambda: printed('resolved'), 'a line of the next core')
    finally:
        ended.set()
        thread.join()


@pytest.mark.parametrize(('seconds', 'text'), [
    ('0', '0 s'), ('119', '119 s'), ('150', '2 min'), ('7300', '2 h'), ('200000', '2 d'),
    ('', '?'), ('nan', '?')])
def test_times_are_written_for_people(seconds: str, text: str) -> None:
    assert duration(seconds) == text
