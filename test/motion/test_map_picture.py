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


"""Maps whose picture is a PNG or a BMP mean what they mean to map_server."""

from __future__ import annotations

from pathlib import Path
import struct
import sys
import zlib

import numpy as np
import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.mapping.slam.archive import load
from rt_robot_os.features.mapping.slam.archive import save
from rt_robot_os.motion.grid_map import GridMap

pil_image = pytest.importorskip('PIL.Image')

GREYS = [0, 100, 180, 205, 254, 255]
CELLS = np.array([[0, 0, 100, -1], [100, -1, 0, 0]], np.int8)


def read(folder: Path, image: object, name: str = 'room.png', lines: str = '',
         **options: object) -> list[int]:
    """Write a map of one row with Pillow, and read it."""
    image.save(folder / name, **options)  # type: ignore[attr-defined]
    return described(folder, name, lines).cells.tolist()[0]


def described(folder: Path, name: str, lines: str = '') -> GridMap:
    (folder / 'room.yaml').write_text(
        f'image: {name}\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n'
        f'occupied_thresh: 0.65\nfree_thresh: 0.196\n{lines}')
    return GridMap.load(folder / 'room.yaml')


def row(kind: str, pixels: list[object]) -> object:
    image = pil_image.new(kind, (len(pixels), 1))
    image.putdata(pixels)
    return image


def palette() -> object:
    image = row('P', list(range(len(GREYS))))
    image.putpalette([each for grey in GREYS for each in (grey, grey, grey)])  # type: ignore
    return image


@pytest.mark.parametrize('lines, values', [
    ('', [100, -1, -1, -1, 0, 0]),
    ('mode: scale\n', [100, 91, 22, 0, 0, 0]),
    ('mode: raw\n', [0, 100, -1, -1, -1, -1])])
@pytest.mark.parametrize('name', ['room.png', 'room.bmp'])
@pytest.mark.parametrize('image', [
    row('L', list(GREYS)), row('RGB', [(each,) * 3 for each in GREYS]), palette()],
    ids=['grey', 'rgb', 'palette'])
def test_greys_mean_the_same_in_every_kind_of_picture(
        tmp_path: Path, image: object, name: str, lines: str, values: list[int]) -> None:
    assert read(tmp_path, image, name, lines) == values


def test_a_colour_is_the_mean_of_its_parts_and_16_bits_are_read(tmp_path: Path) -> None:
    # 0.25 black by the mean; by its luminance green would be 0.3 and more.
    assert read(tmp_path, row('RGB', [(255, 63, 255), (0, 192, 0), (30, 30, 30)]), 'room.png',
                'mode: raw\n') == [-1, 64, 30]
    deep = pil_image.fromarray(np.array([[0, 205 * 257, 65535]], np.uint16))
    assert read(tmp_path, deep) == [100, -1, 0]
    assert read(tmp_path, row('1', [0, 255]), 'room.bmp') == [100, 0]


# Worked out by hand from map_io: in mode trinary (red + green + blue + opacity) / 4.
@pytest.mark.parametrize('pixel, trinary, scale, raw', [
    ((255, 255, 255, 255), 0, 0, -1),        # 1.0: free
    ((255, 255, 255, 0), -1, -1, -1),        # 0.75: unknown
    ((0, 0, 0, 255), 100, 100, 0),           # 0.25: 0.75 black
    ((0, 0, 0, 0), 100, -1, 0),              # 0.0
    ((205, 205, 205, 255), 0, 0, -1),        # 0.853: free, and unknown without opacity
    ((60, 60, 60, 128), 100, -1, 60)])
def test_transparency_counts_as_it_does_in_map_server(
        tmp_path: Path, pixel: tuple[int, ...], trinary: int, scale: int, raw: int) -> None:
    image = row('RGBA', [pixel])
    assert [read(tmp_path, image, lines=f'mode: {mode}\n') for mode in (
        'trinary', 'scale', 'raw')] == [[trinary], [scale], [raw]]


def test_a_transparent_colour_of_a_palette_is_transparent(tmp_path: Path) -> None:
    assert read(tmp_path, palette(), lines='mode: scale\n', transparency=0) == [
        -1, 91, 22, 0, 0, 0]


def test_negate_turns_a_png_round(tmp_path: Path) -> None:
    row('L', list(GREYS)).save(tmp_path / 'room.png')  # type: ignore[attr-defined]
    text = 'image: room.png\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 1\n' \
           'occupied_thresh: 0.65\nfree_thresh: 0.196\n'
    (tmp_path / 'room.yaml').write_text(text)
    assert GridMap.load(tmp_path / 'room.yaml').cells.tolist() == [[0, -1, 100, 100, 100, 100]]


def test_a_map_saved_as_png_is_the_map(tmp_path: Path) -> None:
    before = GridMap(CELLS, 0.05, (1.0, 2.0, 0.5))
    before.save(tmp_path / 'own.yaml', suffix='.png')
    after = GridMap.load(tmp_path / 'own.yaml')
    assert (after.cells == CELLS).all() and after.origin == before.origin
    with pil_image.open(tmp_path / 'own.png') as image:
        assert image.mode == 'L'
    assert save(tmp_path / 'flat.png', None, before) == tmp_path / 'flat.yaml'
    assert sorted(each.name for each in tmp_path.glob('*flat*')) == ['flat.png', 'flat.yaml']
    for name in ('flat', 'flat.yaml', 'flat.png'):
        assert (load(tmp_path / name).grid.cells == CELLS).all()
    with pytest.raises(ConfigError, match='.gif'):
        before.save(tmp_path / 'own.yaml', suffix='.gif')


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack('>I', len(data)) + kind + data + struct.pack('>I', zlib.crc32(kind + data))


def png(width: int, height: int, data: bytes) -> bytes:
    return (b'\x89PNG\r\n\x1a\n' + chunk(b'IHDR', struct.pack('>IIBBBBB', width, height, 8, 0, 0,
                                                              0, 0))
            + chunk(b'IDAT', zlib.compress(data)) + chunk(b'IEND', b''))


@pytest.mark.parametrize('data, said', [
    (png(11_000, 10_000, b''), 'pixels are more than 100000000'),
    (png(60_000, 60_000, b''), '100000000'),
    (png(4, 4, b'\0' * 7), 'is a damaged PNG'),
    (png(4, 4, b'\0' * 20)[:30], 'is a damaged PNG'),
    (b'BM' + b'\0' * 20, 'is a damaged BMP')])
def test_pictures_that_are_damaged_or_too_large_are_refused(
        tmp_path: Path, data: bytes, said: str) -> None:
    (tmp_path / 'room.png').write_bytes(data)
    with pytest.raises(ConfigError, match='room.png') as caught:
        described(tmp_path, 'room.png')
    assert said in str(caught.value)


def test_without_pillow_the_remedy_is_said(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    row('L', list(GREYS)).save(tmp_path / 'room.png')  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, 'PIL.Image', None)
    with pytest.raises(ConfigError, match='room.png: is a PNG, and Pillow is not installed'):
        described(tmp_path, 'room.png')
    with pytest.raises(ConfigError, match='pip install pillow'):
        GridMap(CELLS, 0.05).save(tmp_path / 'own.yaml', suffix='.png')
    assert not (tmp_path / 'own.yaml').exists() and not (tmp_path / 'own.png').exists()
