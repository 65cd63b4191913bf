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

"""What earlier releases recorded and saved is read and replayed by this one, bit by bit."""

from __future__ import annotations

from collections.abc import Callable
import importlib
import json
from pathlib import Path
import platform
import re
import shutil
import sys
from typing import Any

import pytest

from rt_robot_os.settings import load
from rt_robot_os.settings import parameters

pytest.importorskip('mcap', reason='recordings need mcap')
pytest.importorskip('sensor_msgs.msg', reason='the ROS 2 messages are not installed')

FOLDER = Path(__file__).resolve().parent / 'recordings'
SOURCES = FOLDER / 'sources'
# Never made anew: what was recorded was recorded. A release adds a folder of its own, with
# scripts/golden_recordings.py.
RELEASES = sorted(path.name for path in FOLDER.iterdir() if path != SOURCES)
ALLOWED = ('--allow', 'tally:Length', '--allow', 'tally:Stumbling')
RECORDED_ON = 'x86_64'

Run = Callable[..., 'tuple[int, str, str]']


@pytest.fixture
def run(
    golden: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> Run:
    """Run a program in this process; gives its exit code and what it wrote."""
    monkeypatch.syspath_prepend(str(SOURCES))
    monkeypatch.setenv('OPENBLAS_NUM_THREADS', '1')

    def now(program: str, *arguments: str) -> tuple[int, str, str]:
        module, _, function = golden.programs()[program].partition(':')
        monkeypatch.setattr(sys, 'argv', [program, *arguments])
        code = getattr(importlib.import_module(module), function)()
        out, err = capsys.readouterr()
        return code, out, err

    return now


@pytest.mark.parametrize('name', ['robot', 'devices'])
@pytest.mark.parametrize('release', RELEASES)
def test_an_old_recording_replays_identically(
    release: str, name: str, run: Run, golden: Any,
) -> None:
    code, out, err = run('replay', str(FOLDER / release / name), *ALLOWED)
    text = re.sub(r'in [\d.]+ s: \d+ times', 'in X s: Y times', f'{out}{err}')
    if platform.machine() != RECORDED_ON and code == 1:
        pytest.skip(f'floating point differs in the last digit between {RECORDED_ON} and this')
    assert (code, out.splitlines()[-1:]) == (0, ['identical']), text
    golden.check(f'recordings/{release}/{name}.replay.txt', text)


@pytest.mark.parametrize('release', RELEASES)
def test_an_old_dump_of_the_black_box_is_read(
    release: str, run: Run, golden: Any, tmp_path: Path,
) -> None:
    dump = FOLDER / release / 'stumbled.rtbb.gz'
    code, shown, err = run('black_box', 'show', str(dump), '--last', '100')
    assert (code, err) == (0, '')
    golden.check(f'recordings/{release}/stumbled.show.txt', shown)
    out = tmp_path / 'out.json'
    code, text, _ = run('black_box', 'export', str(dump), '--perfetto', str(out))
    assert code == 0
    events = json.loads(out.read_text())['traceEvents']
    assert len(events) > 1000 and f'{len(events)} events' in text
    golden.check(f'recordings/{release}/stumbled.perfetto.txt',
                 ''.join(f'{json.dumps(each)}\n' for each in events[:100]))
    shutil.copy(dump, tmp_path / 'black_box_robot_golden.rtbb.gz')
    code, listed, _ = run('black_box', '--folder', str(tmp_path), 'list')
    assert (code, listed.partition(': ')[2]) == (0, 'golden (2048 records)\n')


@pytest.mark.parametrize('release', RELEASES)
def test_old_saved_parameters_are_laid_over_the_configuration(release: str, run: Run) -> None:
    saved = FOLDER / release / 'robot.saved.yaml'
    found = {each.name: each.value for each in parameters(load([SOURCES / 'robot.yaml', saved]))}
    assert (found['imu.rate_hz'], found['guard.timeout_s']) == (150.0, 0.25)
    assert found['gps.rate_hz'] == 20.0


@pytest.mark.parametrize('release', RELEASES)
def test_old_saved_parameters_are_kept_when_others_are_saved(
    release: str, run: Run, tmp_path: Path,
) -> None:
    module = importlib.import_module('rt_robot_os.settings.saved')
    path = tmp_path / 'robot.saved.yaml'
    shutil.copy(FOLDER / release / path.name, path)
    loaded = {'imu.rate_hz': 150.0, 'guard.timeout_s': 0.25, 'gps.rate_hz': 20.0}
    module.save(path, 'robot', loaded, {**loaded, 'gps.rate_hz': 10.0}, files=['robot.yaml'])
    assert path.read_text() == (FOLDER / release / path.name).read_text().replace(
        'ros__parameters:\n', 'ros__parameters:\n    gps:\n      rate_hz: 10.0\n')
