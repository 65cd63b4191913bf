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

"""
Base classes of decoders of serial protocols: the counters, and the loop that finds frames.

:class:`FrameDecoder` is for formats in which the beginning of a frame determines where its end is,
or where to look for it. A subclass defines how a frame begins, where it ends, and whether it is
valid::

    class SonarDecoder(FrameDecoder[SonarFrame]):
        STARTS = b'#'
        SHORTEST = LONGEST = 9

        def end(self, buffer, at):
            return at + 9

        def frame(self, buffer, at, end, arrived):
            if sum(buffer[at:end]) & 0xFF:
                return None
            return SonarFrame(buffer[at + 2] << 8 | buffer[at + 3], arrived)

:class:`LineDecoder` is for formats of lines.

:class:`StreamDecoder` has only the counters. SCIP needs a loop of its own, because an answer is
known only by its end; so does WitMotion, whose frames are short and many.
"""

from __future__ import annotations

from abc import ABC
from abc import abstractmethod
import re
from typing import ClassVar
from typing import Generic
from typing import TypeVar

FrameT = TypeVar('FrameT')


class StreamDecoder(ABC, Generic[FrameT]):
    """
    The counters of a decoder; each byte fed is in a frame, rejected, or pending.

    :ivar frames: valid frames so far.
    :ivar rejected_bytes: bytes that belong to no valid frame.
    :ivar rejected_frames: frames that were found and are invalid, usually by their checksum.
    """

    def __init__(self) -> None:
        self.frames = 0
        self.rejected_bytes = 0
        self.rejected_frames = 0
        self._pending = b''

    @property
    def pending_bytes(self) -> int:
        """Return the number of bytes kept until the rest of their frame arrives."""
        return len(self._pending)

    def reset(self) -> None:
        """Reject the pending bytes: the stream restarts."""
        self.rejected_bytes += len(self._pending)
        self._pending = b''

    @abstractmethod
    def feed(self, data: bytes) -> list[FrameT]:
        """
        Decode the next bytes of the stream; never raises.

        :return: the frames that they complete, in order; independent of how the stream is split.
        """


class FrameDecoder(StreamDecoder[FrameT]):
    """
    Find the frames in a stream of bytes; safe in the real-time loop, keeps less than ``LONGEST``.

    After an invalid frame it continues with the next byte, so that a false start hides nothing
    behind it. False starts cost more than valid frames: ``PATTERN`` skips most of them in one
    step, and :class:`rt_robot_os.devices.partial_sums.PartialSums` makes checksums of long frames
    cheap.

    :cvar STARTS: the possible first bytes of a frame.
    :cvar PATTERN: a regular expression of the beginning of a frame, if more than its first byte is
        known; empty: one of ``STARTS``. It must match everything that ``end`` does not refuse,
        also where the buffer ends in the middle of it. A dot is any byte.
    :cvar SHORTEST: bytes of the shortest frame.
    :cvar LONGEST: bytes of the longest frame; a longer one is invalid.
    """

    STARTS: ClassVar[bytes]
    SHORTEST: ClassVar[int]
    LONGEST: ClassVar[int]
    PATTERN: ClassVar[bytes] = b''

    def __init__(self) -> None:
        super().__init__()
        # Where the last frame ended, or the stream began; -1 after other bytes.
        self._follows = 0
        self._starts = frozenset(self.STARTS)
        pattern = self.PATTERN or b'[%s]' % re.escape(self.STARTS)
        self._search = re.compile(pattern, re.DOTALL).search

    @abstractmethod
    def end(self, buffer: bytes, at: int) -> int:
        """
        Return where a frame ends.

        :param at: index of one of ``STARTS``; at least ``SHORTEST`` bytes are available.
        :return: index just after its last byte. When more bytes are needed to know it: any index
            behind the buffer, at most ``at + LONGEST``. 0 when it is not a frame.
        """

    @abstractmethod
    def frame(self, buffer: bytes, at: int, end: int, arrived: int) -> FrameT | None:
        """
        Check and decode a complete frame.

        :param arrived: index of its end in the chunk that completed it; the frame's ``end``.
        :return: None when it is not valid, which is counted.
        """

    def feed(self, data: bytes) -> list[FrameT]:
        """
        Decode the next bytes of the stream; never raises.

        :return: the frames that they complete, in order; independent of how the stream is split.
        """
        held = len(self._pending)
        buffer = self._pending + data
        size = len(buffer)
        starts, search = self._starts, self._search
        shortest, longest = self.SHORTEST, self.LONGEST
        frames: list[FrameT] = []
        at = framed = 0
        while at < size:
            if buffer[at] not in starts or size - at < shortest:
                match = search(buffer, at)
                at = size if match is None else match.start()
                if size - at < shortest:
                    break
            end = self.end(buffer, at)
            if at < end <= at + longest:
                if end > size:
                    break
                frame = self.frame(buffer, at, end, end - held)
                if frame is not None:
                    frames.append(frame)
                    framed += end - at
                    at = self._follows = end
                    continue
                self.rejected_frames += 1
            match = search(buffer, at + 1)
            at = size if match is None else match.start()
        self._follows = 0 if self._follows == at else -1
        self.rejected_bytes += at - framed
        self._pending = buffer[at:]
        self.frames += len(frames)
        return frames


class LineDecoder(StreamDecoder[FrameT]):
    """
    Find frames that are lines, ended by a line feed; safe in the real-time loop.

    Other bytes before a frame on the same line make it invalid, so that a lost beginning is
    detected.

    :cvar LONGEST: bytes of the longest line, its end included; a longer one is invalid.
    """

    LONGEST: ClassVar[int]

    def __init__(self) -> None:
        super().__init__()
        self._passing_over = False

    @abstractmethod
    def line(self, buffer: bytes, at: int, end: int, arrived: int) -> FrameT | None:
        """
        Check and decode a line.

        :param end: index just after its line feed.
        :param arrived: the same index in the chunk that completed it.
        :return: None when it is not valid, which is counted.
        """

    def reset(self) -> None:
        """Reject the pending bytes: the stream restarts."""
        super().reset()
        self._passing_over = False

    def feed(self, data: bytes) -> list[FrameT]:
        """
        Decode the next bytes of the stream; never raises.

        :return: the lines that they complete, in order; independent of how the stream is split.
        """
        held = len(self._pending)
        buffer = self._pending + data
        frames: list[FrameT] = []
        at = framed = 0
        while end := buffer.find(b'\n', at) + 1:
            frame = None
            if not self._passing_over and end - at <= self.LONGEST:
                frame = self.line(buffer, at, end, end - held)
            self._passing_over = False
            if frame is None:
                self.rejected_frames += 1
            else:
                frames.append(frame)
                framed += end - at
            at = end
        if self._passing_over or len(buffer) - at >= self.LONGEST:
            self._passing_over = True
            at = len(buffer)
        self.rejected_bytes += at - framed
        self._pending = buffer[at:]
        self.frames += len(frames)
        return frames
