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

"""The frames of a serial line: TinyOS' own bytes, every split, noise, damage."""

from __future__ import annotations

from collections.abc import Iterator
import csv
import gzip
from pathlib import Path
import random
from typing import Any

from broad import examples
from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest

from rt_robot_os.features.wsn.packets.framing import Frame
from rt_robot_os.features.wsn.packets.framing import frame
from rt_robot_os.features.wsn.packets.framing import FrameReader
from rt_robot_os.features.wsn.packets.framing import LONGEST
from rt_robot_os.features.wsn.packets.framing import unescaped
from rt_robot_os.testing.decoder_contract import DecoderContract

# Frames that TinyOS' own programs have written or taken: P, what follows it, bytes on the line.
VECTORS = [
    (0x40, '26', '7e 40 26 68 49 7e'),
    (0x41, '26aabb', '7e 41 26 aa bb 4b c8 7e'),
    (0x42, '14010800ffff7e00117d000005006400620002000000bc0a03002a000000',
     '7e 42 14 01 08 00 ff ff 7d 5e 00 11 7d 5d 00 00 05 00 64 00 62 00 02 00'
     '00 00 bc 0a 03 00 2a 00 00 00 18 e9 7e'),
    (0x42, '14010833fffffffffa7d000000000700070000007e000000000000000000',
     '7e 42 14 01 08 33 ff ff ff ff fa 7d 5d 00 00 00 00 07 00 07 00 00 00'
     '7d 5e 00 00 00 00 00 00 00 00 00 94 ef 7e'),
    (0x45, '00beef0001057d060102030405',
     '7e 45 00 be ef 00 01 05 7d 5d 06 01 02 03 04 05 95 60 7e'),
    (0x44, '0100beef0001057d060102030405',
     '7e 44 01 00 be ef 00 01 05 7d 5d 06 01 02 03 04 05 34 07 7e'),
    (0x43, '01', '7e 43 01 be 48 7e')]
WIRE = [bytes.fromhex(wire) for _, _, wire in VECTORS]
RECORDED = ('chain4_multihoplqi', 'chain4_ctp', 'lossy4_multihoplqi', 'lossy4_ctp')


def body(found: Frame) -> tuple[int, bytes]:
    """Give P and what follows it."""
    return found.protocol, (b'' if found.token < 0 else bytes((found.token,))) + found.packet


def read(*chunks: bytes) -> list[tuple[int, bytes]]:
    """Read chunks with one reader."""
    reader = FrameReader()
    return [body(each) for chunk in chunks for each in reader.feed(chunk)]


class TestFrameReader(DecoderContract):
    stream = b''.join(WIRE)
    tokens = (b'\x7e', b'\x7d', b'\x7e\x42', b'\x7d\x5d', b'\x7d\x7e', WIRE[0][1:], WIRE[2][:-1])
    pending_limit = 1024

    def decoder(self) -> Any:
        """Make a reader."""
        return FrameReader()

    def frame_size(self, frame: Any) -> int:
        """Return the bytes that a frame has on the line."""
        return int(frame.size)

    def covered(self, frame: bytes) -> range:
        """Return what the CRC covers: all but the flags."""
        return range(1, len(frame) - 1)


@pytest.mark.parametrize(('protocol', 'content', 'wire'), VECTORS)
def test_frames_of_tinyos_are_read_and_written(protocol: int, content: str, wire: str) -> None:
    packet = bytes.fromhex(content)
    assert read(bytes.fromhex(wire)) == [(protocol, packet)]
    assert frame(protocol, packet) == bytes.fromhex(wire)


def recorded(data_dir: Path, name: str) -> tuple[bytes, list[tuple[int, bytes]]]:
    """Give a recorded stream, and the frames that are in it as somebody else has found them."""
    path = data_dir / 'wsn' / f'mspsim_{name}.serial.bin'
    if not path.exists():
        pytest.skip(f'no recording at {path}')
    with gzip.open(path.with_name(f'mspsim_{name}.frames.csv.gz'), 'rt') as stream:
        rows = [bytes.fromhex(row['frame_hex_unescaped_with_crc'])
                for row in csv.DictReader(stream)]
    return path.read_bytes(), [(row[0], row[1:-2]) for row in rows]


@pytest.mark.parametrize('name', RECORDED)
def test_a_recorded_line_is_read_whole_and_written_again(name: str, data_dir: Path) -> None:
    stream, expected = recorded(data_dir, name)
    assert read(stream) == expected
    assert b''.join(frame(*each) for each in expected) == stream


@pytest.mark.parametrize('name', RECORDED)
def test_a_recorded_line_is_read_at_every_split_and_with_noise(name: str, data_dir: Path) -> None:
    stream, expected = recorded(data_dir, name)
    chance = random.Random(name)
    assert read(*(stream[at:at + 1] for at in range(len(stream)))) == expected
    for size in (2, 3, 7, 64, 4095):
        assert read(*(stream[at:at + size] for at in range(0, len(stream), size))) == expected
    noisy = bytearray()
    for protocol, content in expected:
        # Without a flag between them the next frame would be a part of the noise.
        noisy += chance.randbytes(chance.randrange(40)) + chance.choice([b'', b'\x7d', b'\x7e'])
        noisy += frame(protocol, content)
    found = read(bytes(noisy))
    assert [each for each in found if each in set(expected)] == expected
    assert read(*(noisy[at:at + 11] for at in range(0, len(noisy), 11))) == found


@pytest.mark.parametrize('wire', WIRE)
def test_two_frames_are_read_at_every_split(wire: bytes) -> None:
    stream = wire + WIRE[2]
    for first in range(len(stream)):
        for second in range(first, min(first + 9, len(stream))):
            assert read(stream[:first], stream[first:second], stream[second:]) == (
                read(wire) + read(WIRE[2]))


def test_frames_may_share_a_flag_and_idle_flags_are_passed_over() -> None:
    shared = WIRE[2] + WIRE[4][1:] + WIRE[0][1:]
    assert read(shared) == read(WIRE[2]) + read(WIRE[4]) + read(WIRE[0])
    reader = FrameReader()
    assert len(reader.feed(b'\x7e' * 20 + WIRE[2] + b'\x7e' * 20)) == 1
    assert (reader.rejected_frames, reader.rejected_bytes, reader.pending_bytes) == (0, 39, 1)


def test_a_flag_after_an_escape_ends_the_frame_and_begins_the_next() -> None:
    reader = FrameReader()
    damaged = WIRE[2][:20] + b'\x7d'
    assert [body(each) for each in reader.feed(damaged + WIRE[4])] == read(WIRE[4])
    assert reader.rejected_frames == 1
    assert read(damaged + WIRE[4][0:1] + WIRE[4][1:]) == read(damaged, WIRE[4]) == read(WIRE[4])


def test_a_wrong_crc_drops_the_frame_and_stays_in_step() -> None:
    reader = FrameReader()
    damaged = bytearray(WIRE[2])
    damaged[9] ^= 1
    # Its closing flag is the opening one of the next.
    assert [body(each) for each in reader.feed(bytes(damaged) + WIRE[4][1:])] == read(WIRE[4])
    assert (reader.rejected_frames, reader.rejected_bytes) == (1, len(damaged) - 1)


def test_a_frame_may_have_256_bytes_and_no_more() -> None:
    longest = frame(0x42, bytes(LONGEST - 3))
    assert read(longest) == [(0x42, bytes(LONGEST - 3))]
    with pytest.raises(ValueError, match='257 bytes: at most 256'):
        frame(0x42, bytes(LONGEST - 2))
    reader = FrameReader()
    too_long = longest[:-1] + bytes(1000)
    found = [each for at in range(len(too_long)) for each in reader.feed(too_long[at:at + 1])]
    assert (found, reader.rejected_frames, reader.rejected_bytes) == ([], 1, len(too_long))
    assert [body(each) for each in reader.feed(WIRE[2])] == read(WIRE[2])


def test_the_longest_frame_of_escapes_alone_is_read() -> None:
    assert read(frame(0x45, b'\x7e' * (LONGEST - 3))) == [(0x45, b'\x7e' * (LONGEST - 3))]


def test_a_cut_frame_at_the_beginning_is_not_held_against_the_line() -> None:
    reader = FrameReader()
    assert len(reader.feed(WIRE[2][17:] + WIRE[4])) == 1
    assert (reader.rejected_frames, reader.rejected_bytes) == (0, len(WIRE[2]) - 17)


def test_what_another_program_means_by_its_p_is_handed_on() -> None:
    assert read(frame(0xFF, b'\x50')) == [(0xFF, b'\x50')]
    assert read(frame(0x50, b'text')) == [(0x50, b'text')]


def reference(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Read frames byte by byte, plainly."""
    crc_bytes = 2
    for part in data.split(b'\x7e'):
        plain = bytearray()
        escaped = False
        for byte in part:
            if escaped:
                plain.append(byte ^ 0x20)
                escaped = False
            elif byte == 0x7D:
                escaped = True
            else:
                plain.append(byte)
        crc = 0
        for byte in plain[:-crc_bytes]:
            crc ^= byte << 8
            for _ in range(8):
                crc = (crc << 1 ^ (0x1021 if crc & 0x8000 else 0)) & 0xFFFF
        if not escaped and 4 <= len(plain) <= LONGEST and (
                crc == plain[-2] | plain[-1] << 8):
            yield plain[0], bytes(plain[1:-crc_bytes])


PIECES = (st.binary(max_size=12) | st.sampled_from([*WIRE, b'\x7e', b'\x7d', b'\x7d\x7e'])
          | st.binary(max_size=40).map(lambda data: frame(0x42, data)))


@settings(max_examples=examples(60))
@given(st.lists(PIECES, max_size=8), st.lists(st.integers(0, 300), max_size=5))
def test_any_bytes_are_read_as_a_plain_reader_does(pieces: list[bytes], cuts: list[int]) -> None:
    data = b''.join(pieces) + b'\x7e'
    edges = sorted({0, len(data), *(min(cut, len(data)) for cut in cuts)})
    chunks = [data[first:last] for first, last in zip(edges, edges[1:])]
    assert read(*chunks) == list(reference(data))


@settings(max_examples=examples(60))
@given(st.lists(st.sampled_from([b'\x7d', b'\x5d', b'\x5e', b'\x20', b'a']), max_size=12))
def test_any_escapes_are_undone(parts: list[bytes]) -> None:
    data = b''.join(parts)
    plain, escaped = bytearray(), False
    for byte in data:
        if escaped or byte != 0x7D:
            plain.append(byte ^ 0x20 if escaped else byte)
            escaped = False
        else:
            escaped = True
    assert unescaped(data) == (None if escaped else bytes(plain))
