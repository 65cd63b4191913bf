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

"""The case devices: recordings of real devices beside drivers and twins."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from benchmarks.devices import sentences
from benchmarks.devices import subjects as subject
from benchmarks.devices import transcript
from benchmarks.devices.case import CASE
from benchmarks.devices.files import text_of
import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.result import RunStatus
from rt_robot_os.tools.bench.result import TargetVerdict

GOOD = {'text': '~^148|-175.91|+98.74|+7.10|182.39`',
        'landmarks': [[48, -175.91, 98.74, 7.1, 182.39]]}
SAID = ('0.5 host->board 620d\n0.501 board->host 35373630300d0a\n'
        '0.6 plant pwm_l 0 pwm_r 0 ticks_l 0 ticks_r 0\n'
        '0.7 host->board 650d\n0.701 board->host 3020300d0a\n')


def verdicts(path: Path) -> set[TargetVerdict]:
    """Say how a recording compares; times of frames are not measured here."""
    options = BenchOptions(0.1, 1, data=str(path))
    runs = {run.key: run for run in CASE.plan(options)}
    outcomes = Outcomes(tuple(runs.values()))
    measured = subject.recorded(Harness(runs['recording'].arguments, -2, 0, path.parent))
    outcomes.add('recording', RunOutcome(RunStatus.OK, '', measured.samples, measured.figures))
    return {target.verdict for target in CASE.evaluate(options, outcomes).targets
            if target.verdict is not TargetVerdict.UNKNOWN}


def test_every_sentence_of_the_collection_is_read_right(data_dir: Path) -> None:
    path = data_dir / 'stargazer' / 'strings.json'
    if not path.is_file():
        pytest.skip(f'no sentences {path}')
    found = sentences.compare(text_of(path), path.name)
    assert found.count >= 5 and found.marks >= 5
    assert (found.wrong, found.wrong_in_noise) == ([], [])


def test_a_sentence_that_means_something_else_is_a_miss(tmp_path: Path) -> None:
    path = tmp_path / 'own.json'
    path.write_text(json.dumps([GOOD, {**GOOD, 'landmarks': [[148, 0, 0, 0, 0]]}]))
    assert verdicts(path) == {TargetVerdict.MISSED}
    path.write_text(json.dumps([GOOD]))
    assert verdicts(path) == {TargetVerdict.REACHED}


def test_the_answers_of_a_board_are_compared(tmp_path: Path) -> None:
    path = tmp_path / 'board.txt'
    path.write_text(SAID)
    assert verdicts(path) == {TargetVerdict.REACHED}
    path.write_text(SAID.replace('35373630300d0a', '39363030ff0d0a'))
    assert verdicts(path) == {TargetVerdict.MISSED}


def test_the_real_firmware_answers_as_the_twin_does(data_dir: Path) -> None:
    path = data_dir / 'motor' / 'ros_arduino_bridge_firmware_1.txt'
    if not path.is_file():
        pytest.skip(f'no recording {path}')
    found = transcript.compare(transcript.read(text_of(path), path.name))
    assert (found.unread_bytes, found.unlike) == (0, 0)
    assert found.counts > 5


@pytest.mark.parametrize(('text', 'says'), [
    ('', 'has no lines such as'), ('hello', 'has no lines such as'),
    ('x host->board 62\n', 'line 1: could not convert'),
    ('0.5 host->board zz\n', 'line 1: non-hexadecimal'),
    ('1e9 host->board 62\n', 'line 1: 1e9 is no time'), ('nan host->board 62\n', 'no time'),
    ('1 plant pwm_l 0\n', 'line 1: the state of the motors has four numbers')])
def test_a_transcript_that_is_none_is_told_with_its_line(text: str, says: str) -> None:
    with pytest.raises(ConfigError, match=says):
        transcript.read(text, 'board.txt')


@pytest.mark.parametrize(('text', 'says'), [
    ('[', 'is no JSON'), ('{}', 'must be a list'), ('[]', 'must be a list'),
    ('[3]', 'entry 1: TypeError'), ('[{"text": "~"}]', "entry 1: KeyError: 'landmarks'"),
    ('[{"text": 3, "landmarks": []}]', 'entry 1: ValueError'),
    ('[{"text": "", "landmarks": [[1, 2]]}]', 'entry 1: ValueError')])
def test_sentences_that_are_none_are_told_with_their_place(text: str, says: str) -> None:
    with pytest.raises(ConfigError, match=says):
        sentences.compare(text, 'own.json')


def test_what_cannot_be_read_is_told(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match='cannot be read: No such file'):
        text_of(tmp_path / 'nothing')
    (tmp_path / 'picture').write_bytes(b'\xff\xd8\xff')
    with pytest.raises(ConfigError, match='is no text'):
        text_of(tmp_path / 'picture')


def test_each_frame_that_is_measured_is_one() -> None:
    for name, decode in subject.frames().items():
        found: Any = decode()
        assert len(found) == 1, name
