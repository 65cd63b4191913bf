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

"""Does a turn on the spot show where the sensor sits."""

from __future__ import annotations

import json
import math
from pathlib import Path
import random

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest
from rt_robot_os.devices.stargazer.turn_command import run
from rt_robot_os.motion.turning import fit_turn


def turn(ahead: float, left: float, degrees: float, noise_m: float = 0.0
         ) -> list[tuple[float, float, float]]:
    chance = random.Random(1)
    found = []
    for n in range(200):
        heading = math.radians(20 + degrees * n / 199)
        cosine, sine = math.cos(heading), math.sin(heading)
        found.append((3.0 + cosine * ahead - sine * left + chance.gauss(0, noise_m),
                      -1.0 + sine * ahead + cosine * left + chance.gauss(0, noise_m), heading))
    return found


@settings(max_examples=50, deadline=None)
@given(ahead=st.floats(-1, 1), left=st.floats(-1, 1), degrees=st.floats(130, 1000))
def test_the_offset_is_found(ahead: float, left: float, degrees: float) -> None:
    fit = fit_turn(turn(ahead, left, degrees))
    assert fit.offset_m == pytest.approx((ahead, left), abs=1e-9)
    assert fit.centre_m == pytest.approx((3.0, -1.0), abs=1e-9)
    assert fit.rms_m < 1e-9


def test_noise_of_a_centimetre_leaves_millimetres() -> None:
    fit = fit_turn(turn(0.12, -0.05, 360, 0.01))
    assert fit.offset_m == pytest.approx((0.12, -0.05), abs=0.003)
    assert fit.rms_m == pytest.approx(0.014, rel=0.1)


@pytest.mark.parametrize('poses, said', [
    ([], '0 poses: at least 10'), (turn(0.1, 0, 90), 'the headings cover 90 degrees: turn by')])
def test_too_little_is_refused(poses: list[tuple[float, float, float]], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        fit_turn(poses)


def test_the_program_reads_what_ros2_topic_echo_wrote(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / 'turn.csv'
    file.write_text('\n'.join(
        f'1,2,map,{x},{y},0.0,0.0,0.0,{math.sin(h / 2)},{math.cos(h / 2)}' + ',0.0' * 36
        for x, y, h in turn(0.2, 0.03, 360)))
    assert run([str(file), '--json']) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found['ahead_m'], found['left_m']) == pytest.approx((0.2, 0.03))
    assert run([str(file)]) == 0
    assert 'Add +0.200 and +0.030 to the first two numbers of mounting_m' in (
        capsys.readouterr().out)


@pytest.mark.parametrize('text, code, said', [
    ('a,b,c', 2, 'line 1 is not a pose: record it with'), ('', 1, '0 poses')])
def test_a_file_without_a_turn(
        text: str, code: int, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / 'turn.csv'
    file.write_text(text)
    assert run([str(file)]) == code
    assert said in capsys.readouterr().err
