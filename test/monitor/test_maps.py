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


"""Check what the server keeps of robots' maps."""

from __future__ import annotations

from pathlib import Path

import pytest

from rt_robot_os.monitor.maps import Maps
from rt_robot_os.uplink.maps import map_message

FLAT = map_message(3, 2, 0.05, (-0.5, 1.0, 0.25), bytes([0, 100, 255, 0, 50, 100]))
OTHER = map_message(1, 1, 0.1, (0.0, 0.0, 0.0), bytes(1))


def test_a_map_is_there_after_a_restart(tmp_path: Path) -> None:
    Maps(tmp_path / 'maps').put('a', {'kind': 'map', **FLAT})
    maps = Maps(tmp_path / 'maps')
    assert maps.get('a') == FLAT
    assert maps.has('a', FLAT['sha256'])
    assert not maps.has('a', OTHER['sha256'])
    assert not maps.has('a', '')


def test_each_robot_has_its_own_map(tmp_path: Path) -> None:
    maps = Maps(tmp_path)
    maps.put('a', FLAT)
    maps.put('b', OTHER)
    maps.put('../../a', OTHER)
    assert [maps.get(each) for each in ('a', 'b', '../../a', 'c')] == [FLAT, OTHER, OTHER, None]
    assert all(each.parent == tmp_path and each.stat().st_mode & 0o077 == 0
               for each in tmp_path.rglob('*'))


def test_what_is_no_map_leaves_the_one_before(tmp_path: Path) -> None:
    maps = Maps(tmp_path)
    maps.put('a', FLAT)
    with pytest.raises(ValueError, match='width'):
        maps.put('a', {**OTHER, 'width': 'wide'})
    assert maps.get('a') == FLAT


def test_a_file_that_is_damaged_is_no_map(tmp_path: Path) -> None:
    maps = Maps(tmp_path)
    maps.put('a', FLAT)
    file, = tmp_path.iterdir()
    for text in ('', '[]', file.read_text()[:-20], '"\ud83d"', '{}'):
        file.write_text(text, errors='surrogatepass')
        assert Maps(tmp_path).get('a') is None
