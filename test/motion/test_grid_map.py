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

"""Maps of ROS: files there and back, greys, places, and what is wrong with a file."""

from __future__ import annotations

import math
from pathlib import Path
import tempfile

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import numpy as np
import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.motion.pgm import read_pgm

YAML = ('image: room.pgm\nresolution: 0.05\norigin: [-1.0, -2.0, 0.0]\nnegate: 0\n'
        'occupied_thresh: 0.65\nfree_thresh: 0.196\n')

CELLS = st.tuples(st.integers(1, 6), st.integers(1, 6)).flatmap(lambda shape: st.lists(
    st.integers(-1, 100), min_size=shape[0] * shape[1], max_size=shape[0] * shape[1]).map(
        lambda values: np.array(values, dtype=np.int8).reshape(shape)))
ORIGINS = st.tuples(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6), st.floats(-4.0, 4.0))


def room(folder: Path, picture: bytes = b'P5\n3 2\n255\n\x00\xcd\xfe\xfe\xfe\x00',
         text: str = YAML) -> GridMap:
    """Write a map of 3 x 2 cells: the top row occupied, unknown, free; then free, free, wall."""
    (folder / 'room.pgm').write_bytes(picture)
    (folder / 'room.yaml').write_text(text)
    return GridMap.load(folder / 'room.yaml')


def told(folder: Path, **given: object) -> str:
    with pytest.raises(ConfigError) as caught:
        room(folder, **given)  # type: ignore[arg-type]
    return str(caught.value)


@settings(deadline=None)
@given(CELLS, st.floats(0.001, 10.0), ORIGINS)
def test_a_map_comes_back_as_it_was_saved(
        cells: np.ndarray, resolution: float, origin: tuple[float, float, float]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a map's.yaml"
        before = GridMap(cells, resolution, origin)
        before.save(path, mode='raw')
        after = GridMap.load(path)
        assert (after.cells == cells).all()
        assert (after.resolution_m, after.origin) == (resolution, origin)
        before.save(path)
        trinary = GridMap.load(path).cells
        assert (trinary == np.where(cells >= 65, 100, np.where(
            (cells >= 0) & (cells <= 20), 0, -1))).all()


def test_the_picture_is_seen_from_above_with_its_first_row_farthest(tmp_path: Path) -> None:
    found = room(tmp_path)
    assert found.cells.tolist() == [[0, 0, 100], [100, -1, 0]]
    assert found.occupied(-0.99, -1.91) and found.occupied(-0.86, -1.99)
    assert found.free(-0.86, -1.91)
    assert found.value(-0.94, -1.91) == -1 and not found.occupied(-0.94, -1.91)
    assert found.bounds == pytest.approx((-1.0, -2.0, -0.85, -1.9))


@pytest.mark.parametrize('point', [(-1.01, -1.95), (0.0, 0.0), (math.nan, 0.0), (math.inf, 0.0),
                                   (1e300, -1e300)])
def test_beyond_the_map_nothing_is_known(tmp_path: Path, point: tuple[float, float]) -> None:
    found = room(tmp_path)
    assert found.cell(*point) is None
    assert not found.occupied(*point) and not found.free(*point)
    assert found.values(np.array([point[0]]), np.array([point[1]])).tolist() == [-1]


@given(ORIGINS, st.integers(0, 5), st.integers(0, 3))
def test_the_middle_of_a_cell_lies_in_it_however_the_map_is_turned(
        origin: tuple[float, float, float], row: int, column: int) -> None:
    found = GridMap(np.zeros((6, 4), dtype=np.int8), 0.25, origin)
    x, y = found.centre(row, column)
    assert found.cell(x, y) == (row, column)
    xs, ys = found.centres()
    assert (xs[row, column], ys[row, column]) == pytest.approx((x, y))
    rows, columns, inside = found.indices(xs, ys)
    assert inside.all() and (rows[row, column], columns[row, column]) == (row, column)


# What nav2_map_server makes of the greys 0, 100, 180, 205, 254 and 255.
@pytest.mark.parametrize('lines, values', [
    ('', [100, -1, -1, -1, 0, 0]),
    ('mode: trinary\n', [100, -1, -1, -1, 0, 0]),
    ('mode: scale\n', [100, 91, 22, 0, 0, 0]),
    ('mode: raw\n', [0, 100, -1, -1, -1, -1]),
    ('mode: Scale\nnegate: 1\n', [0, 43, 100, 100, 100, 100]),
    ('negate: true\n', [0, -1, 100, 100, 100, 100]),
])
def test_greys_mean_what_they_mean_to_map_server(
        tmp_path: Path, lines: str, values: list[int]) -> None:
    text = YAML.replace('negate: 0\n', '') + lines
    found = room(tmp_path, b'P5 6 1 255\n\x00\x64\xb4\xcd\xfe\xff', text)
    assert found.cells.tolist() == [values]


@pytest.mark.parametrize('picture', [
    b'P5 3 2 255\n\x00\xcd\xfe\xfe\xfe\x00',
    b'P5\r\n3\t2 # two rows\n# by hand\n255\n\x00\xcd\xfe\xfe\xfe\x00',
    b'P2\n# CREATOR\n3 2\n255\n0 205 254\n254 # free\n254 0\n',
    b'P5 3 2 65535 ' + bytes([0, 0, 205, 205, 254, 254, 254, 254, 254, 254, 0, 0]),
    b'P2 3 2 51 0 41 51 51 51 0',
    b'P5 3 2 255 # the last comment\n\x00\xcd\xfe\xfe\xfe\x00trailing',
])
def test_all_forms_of_the_picture_are_read(tmp_path: Path, picture: bytes) -> None:
    assert room(tmp_path, picture).cells.tolist() == [[0, 0, 100], [100, -1, 0]]


@pytest.mark.parametrize('picture, text', [
    (b'', 'room.pgm: is not a PGM of kind P5 or P2: its header is missing'),
    (b'GIF89a', 'it is a GIF; convert it'),
    (b'P5 3 2 255\n\x00', 'is cut off: 1 of 6 pixels'),
    (b'P5 3 2 256\n' + bytes(11), 'is cut off: 5 of 6 pixels'),
    (b'P2 3 2 255\n1 2 3', 'is cut off: 3 of 6 pixels'),
    (b'P2 3 2 255\n1 2 3 4 -5 6', "'-5' where a pixel must be"),
    (b'P2 3 2 255\n1 2 3 4 256 6', 'has a pixel of 256, above its highest value, 255'),
    (b'P5 0 2 255\n', 'is empty: 0 x 2 pixels'),
    (b'P5 999999999 999999999 255\n', 'are more than'),
    (b'P5 3 2 0\n', 'its highest value is 0'),
])
def test_a_picture_that_is_none_is_named(tmp_path: Path, picture: bytes, text: str) -> None:
    message = told(tmp_path, picture=picture)
    assert text in message and str(tmp_path / 'room.pgm') in message


@given(st.binary(max_size=40).map(lambda tail: b'P5 2 2 255 ' + tail) | st.binary(max_size=60))
def test_no_bytes_break_the_reader_of_pictures(data: bytes) -> None:
    try:
        pixels, highest = read_pgm(data)
    except ValueError:
        return
    assert pixels.max() <= highest


def test_every_problem_of_the_file_is_told_with_its_line(tmp_path: Path) -> None:
    message = told(tmp_path, text='image: room.pgm\nresolution: -1\norigin: [0, x, 0]\nnegate: 2\n'
                   'occupied_thresh: .nan\nmode: fuzzy\nmode: raw\n')
    path = tmp_path / 'room.yaml'
    assert message.splitlines() == [
        f'{path}:7: mode is there twice: delete one',
        f'{path}:2: resolution: -1 must be the edge of a cell in m, above 0',
        f"{path}:3: origin: 'x' must be a number",
        f"{path}:4: negate: '2' must be 0 or 1",
        f"{path}:5: occupied_thresh: '.nan' must be a number",
        f'{path}: free_thresh is missing']


@pytest.mark.parametrize('text, problem', [
    ('[]', 'is not a map: it must have the keys image'),
    ('', 'is not a map'),
    ('image: [', ':1: not YAML'),
    (YAML.replace('[-1.0, -2.0, 0.0]', '[1, 2]'), ':3: origin: must be a list of three numbers'),
    (YAML.replace('0.196', '0.9'), ':6: free_thresh: 0.9 must not be above'),
    (YAML.replace('room.pgm', 'hall.pgm'), 'hall.pgm: cannot be read: No such file'),
    (YAML.replace('room.pgm', '.'), 'is not a file'),
    ('[' * 5000, 'not YAML'),
])
def test_a_file_that_is_no_map_is_named(tmp_path: Path, text: str, problem: str) -> None:
    message = told(tmp_path, text=text)
    assert problem in message and str(tmp_path) in message


def test_a_file_that_is_missing_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match='flat.yaml: cannot be read'):
        GridMap.load(tmp_path / 'flat.yaml')


@pytest.mark.parametrize('cells, resolution, text', [
    ([[0, 101]], 0.05, 'values from 0 to 101'), ([], 0.05, 'must have rows'),
    ([[0]], 0.0, 'cells above 0'), ([[0]], math.nan, 'all must be finite')])
def test_a_map_of_nonsense_is_refused(cells: list[list[int]], resolution: float, text: str
                                      ) -> None:
    with pytest.raises(ConfigError, match=text):
        GridMap(np.array(cells), resolution)


def test_what_cannot_be_written_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="mode 'scale': use trinary or raw"):
        room(tmp_path).save(tmp_path / 'out.yaml', mode='scale')
