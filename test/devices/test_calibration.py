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

"""Calibration: round trips, identity, what a mounting can be, its file over the robot's own."""

from __future__ import annotations

from itertools import permutations
from itertools import product
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.devices.calibration import AxisMap
from rt_robot_os.devices.calibration import Calibration
from rt_robot_os.devices.calibration import from_settings
from rt_robot_os.devices.calibration import load
from rt_robot_os.devices.calibration import save
from rt_robot_os.devices.calibration import to_settings

NUMBER = st.floats(-100, 100)
VECTOR = st.tuples(NUMBER, NUMBER, NUMBER)
SCALE = st.tuples(*[st.floats(0.5, 2.0)] * 3)
ALL = [' '.join(s + a for s, a in zip(signs, axes))
       for axes in permutations('xyz') for signs in product(('', '-'), repeat=3)]


def parsed(text: str) -> AxisMap | None:
    try:
        return AxisMap.parse(text)
    except ConfigError:
        return None


MAPS = [found for text in ALL if (found := parsed(text))]
CALIBRATION = st.builds(Calibration, VECTOR, SCALE, st.sampled_from(MAPS))


def matrix(axes: AxisMap) -> np.ndarray:
    return np.array([axes.apply(row) for row in np.eye(3)]).T


def test_of_48_mountings_24_are_rotations() -> None:
    assert len(MAPS) == len(set(MAPS)) == 24
    for axes in MAPS:
        assert np.linalg.det(matrix(axes)) == pytest.approx(1)
        assert axes.determinant() == 1
        assert AxisMap.parse(str(axes)) == axes
        assert (matrix(axes) @ matrix(axes.inverse()) == np.eye(3)).all()


@pytest.mark.parametrize('text', ['', 'x y', 'x y y', 'x y z z', 'a b c', '--x y z', 'xyz',
                                  '+-x y z'])
def test_what_is_no_mounting_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match='name each of x, y, z once'):
        AxisMap.parse(text)


@pytest.mark.parametrize('text', ['-x y z', 'y x z', '-x -y -z'])
def test_a_mirror_image_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match='is a mirror image'):
        AxisMap.parse(text)


def test_a_plus_may_be_written() -> None:
    assert AxisMap.parse(' +x  +y +z ') == AxisMap()


@given(VECTOR)
def test_the_default_changes_nothing(vector: tuple[float, float, float]) -> None:
    assert Calibration().apply(vector) == vector
    assert Calibration().undo(vector) == vector


@given(CALIBRATION, VECTOR)
def test_undo_is_the_inverse(calibration: Calibration, vector: tuple[float, ...]) -> None:
    assert calibration.undo(calibration.apply(vector)) == pytest.approx(vector, abs=1e-9)
    assert calibration.apply(calibration.undo(vector)) == pytest.approx(vector, abs=1e-9)


@given(CALIBRATION, st.tuples(*[st.integers(-32768, 32767)] * 3), st.floats(1e-6, 1.0))
def test_folded_is_the_same_with_the_unit_in_it(
        calibration: Calibration, counts: tuple[int, ...], unit: float) -> None:
    (a, b, c), (i, j, k), (p, q, r) = calibration.folded(unit)
    found = (counts[a] * i + p, counts[b] * j + q, counts[c] * k + r)
    assert found == pytest.approx(calibration.apply([n * unit for n in counts]), abs=1e-6)


@given(st.lists(VECTOR, min_size=2, max_size=2), st.sampled_from(MAPS), SCALE)
def test_offset_is_what_the_sensor_shows_at_zero(
        vectors: list[tuple[float, float, float]], axes: AxisMap,
        scale: tuple[float, float, float]) -> None:
    calibration = Calibration(vectors[0], scale, axes)
    assert calibration.apply(vectors[0]) == (0, 0, 0)
    length = np.linalg.norm(axes.apply(vectors[1]))
    assert length == pytest.approx(np.linalg.norm(vectors[1]))


@given(offset=VECTOR, scale=SCALE, other=VECTOR, axes=st.sampled_from(MAPS))
def test_settings_and_back(offset: tuple[float, float, float], scale: tuple[float, float, float],
                           other: tuple[float, float, float], axes: AxisMap) -> None:
    both = {'acceleration': Calibration(offset, scale, axes),
            'angular_velocity': Calibration(other, (1.0, 1.0, 1.0), axes)}
    settings = to_settings(both)
    assert {name: from_settings('imu', settings, name) for name in both} == both


def test_one_device_has_one_mounting() -> None:
    with pytest.raises(ConfigError, match='a device has one mounting'):
        to_settings({'a': Calibration(), 'b': Calibration(axes=AxisMap.parse('x -y -z'))})


def test_every_problem_is_told_at_once() -> None:
    with pytest.raises(ConfigError) as caught:
        from_settings('imu', {'axes': 'x x x', 'a_offset': [1.0], 'a_scale': []}, 'a')
    assert [p.split(' = ')[0] for p in caught.value.problems] == [
        'imu.axes', 'imu.a_offset', 'imu.a_scale']


def test_a_file_is_read_as_it_was_written(tmp_path: Path) -> None:
    path = tmp_path / 'imu.yaml'
    both = {'acceleration': Calibration((1e-5, -0.25, 1 / 3), (0.99, 1.01, 1.0),
                                        AxisMap.parse('-y x z')),
            'angular_velocity': Calibration((0.1, 2e-17, 0.0), axes=AxisMap.parse('-y x z'))}
    save(path, 'imu', both)
    save(path, 'imu', both)
    assert load(path, 'imu', tuple(both)) == both
    assert [p.name for p in tmp_path.iterdir()] == ['imu.yaml']


@pytest.mark.parametrize('text', [
    '', '1', '[', '/**: 3', '/**: {ros__parameters: {gps: {}}}', '/**: {ros__parameters: {imu: }}',
    '/**: {ros__parameters: {imu: {axes: x y z}}}', '\x00'])
def test_a_file_that_is_none_names_itself(text: str, tmp_path: Path) -> None:
    path = tmp_path / 'imu.yaml'
    path.write_text(text)
    with pytest.raises(ConfigError, match='imu.yaml holds no calibration of acceleration.*again'):
        load(path, 'imu', ['acceleration'])


def test_a_wrong_value_in_a_file_names_file_and_key(tmp_path: Path) -> None:
    path = tmp_path / 'imu.yaml'
    save(path, 'imu', {'acceleration': Calibration()})
    path.write_text(path.read_text().replace('x y z', 'x y y'))
    with pytest.raises(ConfigError, match=r'imu.yaml: imu.axes = .x y y.: name each'):
        load(path, 'imu', ['acceleration'])
