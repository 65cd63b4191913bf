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

"""Does the loop that finds frames keep its word, whatever a subclass says of its format."""

from __future__ import annotations

from typing import Any
from typing import NamedTuple

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest
from rt_robot_os.devices.framing import FrameDecoder
from rt_robot_os.testing import DecoderContract


class Frame(NamedTuple):
    content: bytes
    end: int


class Boxes(FrameDecoder[Frame]):
    """``[`` or ``{``, how long the content is, two of those for ``{``, content, sum."""

    STARTS = b'[{'
    SHORTEST = 3
    LONGEST = 40

    def end(self, buffer: bytes, at: int) -> int:
        assert buffer[at] in self.STARTS
        assert len(buffer) - at >= self.SHORTEST
        if buffer[at:at + 1] == b'[':
            return at + 3 + buffer[at + 1]
        if len(buffer) - at < 4:
            return at + 4
        return at + 4 + buffer[at + 1] + buffer[at + 2]

    def frame(self, buffer: bytes, at: int, end: int, arrived: int) -> Frame | None:
        good = sum(buffer[at:end - 1]) & 0xFF == buffer[end - 1]
        return Frame(buffer[at:end], arrived) if good else None


class Blocks(FrameDecoder[Frame]):
    """``]``, then any two bytes; nothing is checked."""

    STARTS = b']'
    SHORTEST = LONGEST = 3

    def end(self, buffer: bytes, at: int) -> int:
        return at + 3

    def frame(self, buffer: bytes, at: int, end: int, arrived: int) -> Frame | None:
        return Frame(buffer[at:end], arrived)


def box(content: bytes) -> bytes:
    body = b'[%c%s' % (len(content), content)
    return body + bytes((sum(body) & 0xFF,))


def long_box(content: bytes) -> bytes:
    half = len(content) // 2
    body = b'{%c%c%s' % (half, len(content) - half, content)
    return body + bytes((sum(body) & 0xFF,))


class TestBoxes(DecoderContract):
    stream = box(b'') + long_box(b'[{[') + box(b'abc') + long_box(b'') + box(bytes(37))
    tokens = (b'[', b'{', b'[\x03', b'{\x14\x14', b'{\x13\x11', b'[[[[', box(b'x'))
    pending_limit = 40

    def decoder(self) -> Any:
        return Boxes()

    def frame_size(self, frame: Frame) -> int:
        return len(frame.content)


class TestBlocks(DecoderContract):
    stream = b']ab]]]]cd'
    tokens = (b']', b']]', b'a]')
    pending_limit = 3

    def decoder(self) -> Any:
        return Blocks()

    def frame_size(self, frame: Frame) -> int:
        return 3

    def covered(self, frame: bytes) -> tuple[int, ...]:
        return ()  # it has no checksum


def test_a_frame_inside_of_what_is_none_is_found() -> None:
    good = box(b'abc')
    decoder = Boxes()
    frames = decoder.feed(b'[\x08' + good + b'??' + b'!' + good)
    assert [f.content for f in frames] == [good, good]
    assert (decoder.rejected_frames, decoder.rejected_bytes) == (1, 5)


def test_the_longest_frame_and_one_more() -> None:
    assert len(box(bytes(37))) == Boxes.LONGEST
    assert len(Boxes().feed(box(bytes(37)))) == 1
    decoder = Boxes()
    assert decoder.feed(box(bytes(38))) == []
    assert (decoder.rejected_frames, decoder.pending_bytes) == (0, 0)


def test_the_end_is_counted_from_the_chunk_that_completed_the_frame() -> None:
    decoder = Boxes()
    data = box(b'abc') + box(b'')
    assert decoder.feed(data[:4]) == []
    assert [f.end for f in decoder.feed(data[4:])] == [2, 5]


def test_what_a_bad_beginning_hid_had_arrived_before() -> None:
    decoder = Boxes()
    assert decoder.feed(b'[\x06' + box(b'ab')) == []
    frame, = decoder.feed(b'?????')
    assert (frame.content, frame.end) == (box(b'ab'), 0)


@pytest.mark.parametrize('ends', [(-1,), (0,), (1,), (1 << 40,), (9, -9, 0, 60, 7)])
@settings(max_examples=20, deadline=None)
@given(chunks=st.lists(st.binary(max_size=60) | st.just(b'[' * 50), max_size=8))
def test_nonsense_of_a_subclass_neither_hangs_it_nor_fills_the_memory(
    ends: tuple[int, ...], chunks: list[bytes],
) -> None:
    class Nonsense(Boxes):
        def end(self, buffer: bytes, at: int) -> int:
            return at + ends[buffer[at + 1] % len(ends)]

    decoder = Nonsense()
    framed = 0
    for chunk in chunks:
        framed += sum(len(frame.content) for frame in decoder.feed(chunk))
        assert decoder.pending_bytes < Boxes.LONGEST
    fed = sum(map(len, chunks))
    assert fed == framed + decoder.rejected_bytes + decoder.pending_bytes
