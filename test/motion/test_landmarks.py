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

"""Are landmarks read from texts, YAML and CSV, in any unit, and is what is wrong told."""

from __future__ import annotations

import math
import os
from pathlib import Path

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.motion.landmarks import CeilingLandmark
from rt_robot_os.motion.landmarks import landmarks_of
from rt_robot_os.motion.landmarks import read_landmarks

ROOM = """id,x_cm,y_cm,yaw_deg
10546,-326,545,0.01
10576,-317,300,-3.1

# not yet measured
10640,-5.9,242,-1.7
"""
DATA = Path(os.environ.get('RT_ROBOT_OS_DATA', Path(__file__).parents[3] / 'shared' / 'data'))


def test_texts() -> None:
    assert landmarks_of(['24706: 1.5, -2, 0.5', '34 0 0'], 'gazer: landmarks') == {
        24706: CeilingLandmark(24706, 1.5, -2.0, 0.5), 34: CeilingLandmark(34, 0.0, 0.0, 0.0)}


def test_csv_in_centimetres_and_degrees() -> None:
    room = read_landmarks(ROOM, 'room.csv')
    assert list(room) == [10546, 10576, 10640]
    assert room[10576] == pytest.approx((10576, -3.17, 3.0, math.radians(-3.1)))


@pytest.mark.parametrize('text', [
    'landmarks:\n  7: [1.0, 2.0, 0.5]\n  8: {x_cm: 300, y: 4}\n',
    '7: [1, 2, 0.5]\n8: [3, 4]\n',
    'landmarks:\n- {id: 7, x: 1, y: 2, yaw: 0.5}\n- {id: 8, x: 3, y_mm: 4000}\n',
    '- [7, 1, 2, 0.5]\n- [8, 3, 4]\n',
    'seed: 1\nlandmarks: ["7: 1, 2, 0.5", 8 3 4]\n'])
def test_every_form_of_yaml(text: str) -> None:
    assert read_landmarks(text, 'room.yaml') == {
        7: CeilingLandmark(7, 1.0, 2.0, 0.5), 8: CeilingLandmark(8, 3.0, 4.0, 0.0)}


def test_the_marks_of_a_real_room() -> None:
    path = DATA / 'stargazer' / 'landmarks_of_a_real_room.csv'
    if not path.exists():
        pytest.skip('the recorded data is not here')
    room = read_landmarks(path.read_text(), path.name)
    assert len(room) == 13
    assert room[10642] == pytest.approx((10642, 1.81, 4.90, math.radians(-2.1)))


@pytest.mark.parametrize('name, text, said', [
    ('a.csv', 'x,y\n1,2\n', 'a.csv: the first line must name the columns'),
    ('a.csv', '', 'a.csv: the first line must name the columns'),
    ('a.csv', 'id,x,y\n1,2,3\n1,3,4\n', 'a.csv: line 3: landmark 1 is there twice: delete one'),
    ('a.csv', 'id,x,y\n#\n1,2,near\n', 'a.csv: line 3: must be a number from 0'),
    ('a.csv', 'id,x,y\n1,2,3,4,5\n', 'a.csv: line 2: must be a number from 0'),
    ('a.csv', 'id,x_inch,y\n1,2,3\n', "a.csv: line 2: 'x_inch' is unknown"),
    ('a.yaml', 'landmarks: 5\n', 'a.yaml holds no landmarks'),
    ('a.yaml', '{', 'a.yaml is not YAML'),
    ('a.yaml', '1: [.nan, 0, 0]', 'landmark 1: must be a number from 0'),
    ('a.yaml', '1.5: [0, 0, 0]', 'landmark 1.5: must be a number from 0'),
    ('a.yaml', '1: {x: 0, x_cm: 0, y: 1}', "landmark 1: 'x_cm' is unknown or duplicate"),
    ('a.yaml', '-1: [0, 0]', 'landmark -1: must be a number from 0')])
def test_what_is_wrong_is_told(name: str, text: str, said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        read_landmarks(text, name)
    assert said in str(caught.value)


@settings(max_examples=60, deadline=None)
@given(text=st.text(max_size=80), name=st.sampled_from(('a.csv', 'a.yaml')))
def test_any_file_is_read_or_refused(text: str, name: str) -> None:
    for prefix in ('', 'id,x,y\n', 'landmarks:\n- '):
        try:
            for landmark in read_landmarks(prefix + text, name).values():
                assert all(map(math.isfinite, landmark))
        except ConfigError as error:
            assert name in str(error)
