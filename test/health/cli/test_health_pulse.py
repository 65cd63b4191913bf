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

"""The command `health pulse` on recorded waveforms."""

from __future__ import annotations

import json
from pathlib import Path
import shutil

import pytest
from rt_robot_os.features.health.cli.program import main


def test_a_record_with_a_false_alarm_has_a_pulse_that_is_that_of_its_ecg(
        data_dir: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['pulse', str(data_dir / 'vitals' / 'a103l.hea'), '--json']) == 0
    found, = json.loads(capsys.readouterr().out)['files']
    assert found['comments'] == ['Asystole', 'False alarm']
    assert (found['asystole'], found['leads']) == (False, ['II', 'V'])
    assert found['believed'] > 240 and len(found['each_second']) == found['seconds'] == 321
    assert found['compared']['windows'] > 150 and found['compared']['beyond'] == 0


def test_damaged_files_are_told_beside_good_ones(
        data_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    vitals = data_dir / 'vitals'
    shutil.copy(vitals / 'a103l.hea', tmp_path)
    (tmp_path / 'a103l.mat').write_bytes((vitals / 'a103l.mat').read_bytes()[:1000])
    numerics = next(vitals.glob('s25047*.hea'))
    assert main(['pulse', str(tmp_path / 'a103l.hea'), str(numerics)]) == 1
    out = capsys.readouterr().out.splitlines()
    assert len(out) == 2
    assert 'it is truncated' in out[0]
    assert 'has no signal PLETH or PPG' in out[1] and 'only HR, PULSE' in out[1]
