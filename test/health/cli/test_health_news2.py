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

"""The command `health news2` on the cases of others, and on what people write."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from rt_robot_os.features.health.assessment.news2 import PARAMETERS
from rt_robot_os.features.health.cli.program import main

GOOD = {'id': 'well', 'resp': 18, 'spo2': 97, 'oxygen': False, 'systolic': 120, 'pulse': 70,
        'consciousness': 'Alert', 'temperature': 36.8, 'scale': 1}


@pytest.fixture
def news2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Any:
    """Return what scores cases, or the text of a file: the exit code and the object written."""
    def run(cases: Any) -> tuple[int, dict[str, Any]]:
        path = tmp_path / 'cases.json'
        path.write_text(cases if isinstance(cases, str) else json.dumps(cases))
        code = main(['news2', str(path), '--json'])
        out = capsys.readouterr().out
        return code, json.loads(out) if out else {}
    return run


def test_the_cases_of_a_guideline_agree_in_every_field(
        data_dir: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = data_dir / 'vitals' / 'news2_gdl.json'
    assert main(['news2', str(path), '--json']) == 0
    found = json.loads(capsys.readouterr().out)
    wanted = json.loads(path.read_text())
    assert (found['cases'], found['agree'], found['differ']) == (len(wanted), len(wanted), 0)
    for case, expected in zip(found['files'][0]['cases'], wanted):
        # Five sub-scores, the total, the risk, the response and the frequency.
        assert case['compared'] == 9
        assert case['total'] == expected['total'] and case['complete']
        assert case['scores']['systolic_mmhg'] == expected['systolic_score']
    assert main(['news2', str(path)]) == 0
    assert '10 agree with the expected score, 0 differ' in capsys.readouterr().out


@pytest.mark.parametrize('change, total', [
    ({'consciousness': 'ALERT'}, 0), ({'consciousness': 'a'}, 0), ({'consciousness': 'V'}, 3),
    ({'consciousness': 'unresponsive'}, 3), ({'consciousness': 'Responds to Pain'}, 3),
    ({'consciousness': 'new-onset Confusion'}, 3), ({'consciousness': 'CVPU'}, 3),
    ({'oxygen': 'Air'}, 0), ({'oxygen': 'yes'}, 2), ({'oxygen': 2.5}, 2), ({'oxygen': True}, 2),
    ({'scale': '2', 'oxygen': True}, 5), ({'scale': 'SpO2 Scale 2', 'oxygen': 'oxygen'}, 5),
    ({'scale': None}, 0), ({'pulse': '135'}, 3), ({'temperature': '38.05'}, 1),
    ({'temperature': '38,05 °C', 'pulse': '91 bpm', 'spo2': '97 %', 'systolic': '120 mmHg'}, 2),
    ({'consciousness': 'not alert'}, 3), ({'risk': '', 'response': None, 'pulse_score': ''}, 0)])
def test_values_are_read_as_people_write_them(
        news2: Any, change: dict[str, Any], total: int) -> None:
    code, found = news2([{**GOOD, **change, 'total': total}])
    assert code == 0, found
    assert found['files'][0]['cases'][0]['total'] == total


def test_other_names_and_nesting() -> None:
    from rt_robot_os.features.health.cli.news2_cases import case_of
    case = case_of({'Name': 'x', 'inputs': {
        'Respiratory Rate': 9, 'SpO2 (%)': 95, 'On-Oxygen': 'no', 'SBP': 105, 'heart_rate': 45,
        'ACVPU': 'C', 'Temp': 35.5}, 'expected': {'News2': 8, 'RR_score': 1}}, 1)
    assert [case.values[name] for name in PARAMETERS] == [9, 95, 0, 105, 45, 1, 35.5]
    assert not case.problems
    from rt_robot_os.features.health.assessment.news2 import score
    assert case.compare(score(case.values, case.scale)) == (2, [])


def test_what_is_not_there_is_missing_and_no_score_is_given(news2: Any) -> None:
    for nothing in (None, '', '-', 'NaN', 0):
        code, found = news2([{**GOOD, 'pulse': nothing, 'total': None}])
        case = found['files'][0]['cases'][0]
        assert code == 0
        assert (case['total'], case['complete'], case['missing']) == (
            None, False, ['pulse_per_min'])
        assert case['risk'] is None and case['scores']['pulse_per_min'] is None
    code, found = news2([{'id': 'empty'}])
    assert found['incomplete'] == 1 and len(found['files'][0]['cases'][0]['missing']) == 7


def test_a_case_that_differs_or_cannot_be_read_says_how(
        news2: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cases = [{**GOOD, 'total': 4, 'pulse_score': 1, 'risk': 'high', 'response': 'Emergency team'},
             {**GOOD, 'pulse': 'fast', 'temperature': 368, 'scale': 7}]
    code, found = news2(cases)
    first, second = found['files'][0]['cases']
    assert code == 1 and found['differ'] == 2
    assert first['differences'] == [
        'total: 0 instead of 4', 'pulse_per_min score: 0 instead of 1',
        'risk: Low instead of High', 'response: Low instead of High']
    assert second['problems'] == [
        "pulse_per_min: 'fast' cannot be parsed as a value",
        'body_temperature: 368 degC is not plausible: must be 15 to 46; it counts as missing',
        "scale '7': must be 1 or 2; 1 was used"]
    assert main(['news2', str(tmp_path / 'cases.json')]) == 1
    assert 'total: 0 instead of 4' in capsys.readouterr().out


@pytest.mark.parametrize('text', ['', '[]', '3', '[3]', 'resp,spo2', '\x00', '[' * 100_000])
def test_a_file_without_cases_is_refused(news2: Any, text: str) -> None:
    assert news2(text)[0] == 2


@pytest.mark.parametrize('text', [
    json.dumps({'cases': [GOOD, GOOD]}), json.dumps(GOOD) + '\n' + json.dumps(GOOD) + '\n'])
def test_other_shapes_of_a_file(news2: Any, text: str) -> None:
    code, found = news2(text)
    assert (code, found['cases']) == (0, 2)
