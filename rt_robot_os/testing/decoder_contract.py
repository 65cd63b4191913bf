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


"""The contract of every decoder for any bytes; a part of :class:`DriverContract`."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterable
from typing import Any
from typing import ClassVar
from typing import Final
from typing import NamedTuple

from rt_robot_os.devices.framing import FrameDecoder
from rt_robot_os.testing.examples import check_with_examples
from rt_robot_os.testing.examples import strategies
from rt_robot_os.testing.work import costliest_input
from rt_robot_os.testing.work import steps_per_byte

# No decoder may keep more bytes than this after a false start.
MOST_PENDING: Final = 16_384
# Limits of the cost of any bytes: as a multiple of valid ones, and in steps per byte.
MOST_TIMES_GOOD: Final = 10
FEW_STEPS: Final = 20
_FLIPS: Final = (0x01, 0x80, 0xFF)


class Decoded(NamedTuple):
    """
    The result of a decoder.

    :ivar places: position of each frame in the stream, begin and end.
    :ivar pending: bytes.
    """

    places: list[tuple[int, int]]
    rejected_bytes: int
    rejected_frames: int
    pending: int


class DecoderContract:
    """
    The contract of a decoder, without a device.

    :cvar stream: valid bytes of a few samples, whole frames.
    :cvar tokens: pieces of the protocol, mixed with random bytes.
    :cvar pending_limit: the decoder keeps less than this.
    """

    stream: ClassVar[bytes]
    tokens: ClassVar[tuple[bytes, ...]]
    pending_limit: ClassVar[int] = 256

    def decoder(self) -> Any:
        """Make a decoder."""
        raise NotImplementedError

    def frame_size(self, frame: Any) -> int:
        """Return the number of bytes of a frame."""
        raise NotImplementedError

    def covered(self, frame: bytes) -> Iterable[int]:
        """
        Return the indices of the bytes that the checksum of a frame covers; all by default.

        For a format without a checksum: ``return ()``.
        """
        return range(len(frame))

    def decode(self, chunks: list[bytes], decoder: Any = None) -> Decoded:
        """Feed a decoder, a new one by default, and check its counters after each chunk."""
        decoder = decoder or self.decoder()
        before = decoder.rejected_bytes + decoder.pending_bytes
        frames, rejected_bytes = decoder.frames, decoder.rejected_bytes
        places: list[tuple[int, int]] = []
        fed = framed = 0
        for chunk in chunks:
            for frame in decoder.feed(chunk):
                end = fed + frame.end
                places.append((end - self.frame_size(frame), end))
                framed += self.frame_size(frame)
            fed += len(chunk)
            assert decoder.frames == frames + len(places)
            assert decoder.rejected_bytes >= rejected_bytes, 'a counter decreased'
            assert framed + decoder.rejected_bytes + decoder.pending_bytes == before + fed
            assert decoder.pending_bytes < self.pending_limit
            rejected_bytes = decoder.rejected_bytes
        return Decoded(places, rejected_bytes, decoder.rejected_frames, decoder.pending_bytes)

    def any_chunks(self) -> Any:
        """Return the strategy of chunks: noise, tokens, valid and damaged frames."""
        st = strategies()
        cut = st.tuples(st.integers(0, len(self.stream)), st.integers(0, len(self.stream)))
        parts = cut.map(lambda at: self.stream[min(at):max(at)])
        return st.lists(st.binary(max_size=30) | st.sampled_from((*self.tokens, self.stream))
                        | parts, max_size=12)

    def check_with_any_chunks(self, check: Callable[[list[bytes]], None]) -> None:
        """Run a check on many examples."""
        check_with_examples(self.any_chunks(), check, 40)

    def test_frames_are_the_same_however_the_stream_is_cut(self) -> None:
        def check(chunks: list[bytes]) -> None:
            whole = b''.join(chunks)
            expected = self.decode([whole])
            assert self.decode(chunks) == expected
            assert self.decode([whole[at:at + 1] for at in range(len(whole))]) == expected

        self.check_with_any_chunks(check)

    def test_frames_neither_overlap_nor_go_back(self) -> None:
        def check(chunks: list[bytes]) -> None:
            edges = [edge for place in self.decode(chunks).places for edge in place]
            assert edges == sorted(edges)

        self.check_with_any_chunks(check)

    def test_the_bytes_of_a_frame_alone_are_a_frame(self) -> None:
        def check(chunks: list[bytes]) -> None:
            whole = b''.join(chunks)
            for begin, end in self.decode(chunks).places:
                assert self.decode([whole[begin:end]]) == ([(0, end - begin)], 0, 0, 0)

        self.check_with_any_chunks(check)

    def test_after_a_reset_the_stream_is_decoded_whole(self) -> None:
        expected = len(self.decode([self.stream]).places)

        def check(chunks: list[bytes]) -> None:
            decoder = self.decoder()
            rejected = self.decode(chunks, decoder)
            decoder.reset()
            assert decoder.pending_bytes == 0
            assert decoder.rejected_bytes == rejected.rejected_bytes + rejected.pending
            again = self.decode([self.stream], decoder)
            assert len(again.places) == expected
            assert again.rejected_bytes == decoder.rejected_bytes
            assert again.pending == 0

        self.check_with_any_chunks(check)

    def test_nothing_makes_it_keep_more_than_its_limit(self) -> None:
        for token in (*self.tokens, self.stream[:-1], b'\x00', b'\xff'):
            for size in (1, 7, 4096):
                endless = token * (3 * self.pending_limit // len(token) + 1)
                self.decode([endless[at:at + size] for at in range(0, len(endless), size)])

    # --- damage ---------------------------------------------------------------------------------

    def frames(self) -> list[bytes]:
        """Return the distinct frames of the stream."""
        return list(dict.fromkeys(
            self.stream[begin:end] for begin, end in self.decode([self.stream]).places))

    def test_a_frame_with_a_wrong_byte_is_none(self) -> None:
        assert self.frames(), 'the stream contains no frame'
        for frame in self.frames():
            for at in self.covered(frame):
                for flip in _FLIPS:
                    damaged = frame[:at] + bytes((frame[at] ^ flip,)) + frame[at + 1:]
                    for begin, end in self.decode([damaged + self.stream]).places:
                        assert not begin <= at < end, (
                            f'{damaged!r} is accepted as a frame although its byte {at} is wrong: '
                            'check the checksum; if it does not cover that byte, exclude it in '
                            'covered()')

    def test_a_beginning_without_an_end_hides_only_what_follows_at_once(self) -> None:
        count = len(self.decode([self.stream]).places)
        behind = self.stream * (self.pending_limit // len(self.stream) + 2)
        for frame in self.frames():
            for cut in range(1, len(frame), len(frame) // 64 + 1):
                data = frame[:cut] + behind
                whole = [place for place in self.decode([data]).places
                         if place[0] >= len(data) - len(self.stream)]
                assert len(whole) == count, (
                    f'after {frame[:cut]!r} without its end {len(behind)} valid bytes are not '
                    'enough to find the frames again')

    def test_no_header_makes_it_wait_for_more_than_its_limit(self) -> None:
        assert self.pending_limit <= MOST_PENDING, (
            f'a decoder that waits for up to {self.pending_limit} bytes is delayed by as many '
            f'after a false start: at most {MOST_PENDING}')
        decoder = self.decoder()
        if isinstance(decoder, FrameDecoder):
            assert decoder.LONGEST <= self.pending_limit, (
                f'LONGEST is {decoder.LONGEST}: set it to the length of the longest frame of the '
                'device, and pending_limit accordingly')
        rest = bytes(2 * self.pending_limit)
        for frame in self.frames():
            head = frame[:16]
            for at in range(len(head)):
                for byte in range(256):
                    for size in (1, 2):
                        lie = bytes((byte,)) * size
                        self.decode([head[:at] + lie + head[at + size:] + rest])

    def test_no_bytes_cost_much_more_than_good_ones(self) -> None:
        size = max(1024, 2 * self.pending_limit)
        good = steps_per_byte(self.decoder(), self.stream * (size // len(self.stream) + 1))
        frames = self.frames()
        heads = [frame[:cut] for frame in frames[:2] for cut in range(1, 8)]
        # Partial headers, and large lengths.
        seeds = [*self.tokens, b'\n', b'\x00', *heads, *(frame[:-1] for frame in frames[:4]),
                 *(head + far for head in heads for far in (b'\xff', b'\x07\xff', b'\xff\x07',
                                                            b'\xff\x07\xff'))]
        cost, piece = costliest_input(self.decoder, seeds, size, 40)
        allowed = max(MOST_TIMES_GOOD * good, FEW_STEPS)
        assert cost <= allowed, (
            f'{piece!r} repeated costs {cost:.0f} steps per byte, valid frames {good:.1f}: at '
            f'most {allowed:.0f}, or a noisy line stops the robot. Process each byte only a few '
            'times: PATTERN and PartialSums help')
