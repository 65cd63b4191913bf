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

"""Write the samples of one topic of the core to a file: as in ROS, and for a replay."""

from __future__ import annotations

from collections.abc import Sequence
import struct
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.link.protocol import Header
from rt_robot_os.link.stamp_mapper import StampLine
from rt_robot_os.recording.bag_file import BagFile
from rt_robot_os.recording.bag_info import TopicFacts
from rt_robot_os.recording.graph import ShownTopic

_STAMP: Final = struct.Struct('<iI')
_FOREVER_NS: Final = 1 << 63


class Outlet:
    """
    A topic of the bag.

    :ivar channel: its number in the file.
    :ivar latched: late subscribers receive its last message.
    """

    __slots__ = ('facts', 'channel', 'latched', '_convert', '_joint', '_last')

    def __init__(self, shown: ShownTopic) -> None:
        self.facts = shown.facts
        self.channel = 0
        self.latched = shown.latched
        self._last: tuple[bytes | bytearray, int, int] | None = None
        self._convert = shown.convert
        self._joint = shown.joint

    def write(self, file: BagFile, log_ns: int, cdr: bytes | bytearray, sequence: int,
              wall_ns: int) -> bool:
        """
        Write a sample.

        :return: False if it cannot be converted.
        """
        data: bytes | bytearray = cdr
        if self._convert is not None:
            try:
                data = self._convert(memoryview(cdr), wall_ns)
            except ValueError:
                return False
            if self._joint:
                sequence = 0  # the numbers of several topics have no common order
        file.add(self.channel, log_ns, data, sequence, wall_ns)
        if self.latched:
            self._last = data, sequence, wall_ns
        return True

    def begin(self, file: BagFile, channel: int, begin_ns: int) -> bool:
        """
        Continue in another file, which begins with the last message of a latched topic.

        :param begin_ns: time of day at which the file begins.
        :return: whether there is such a message.
        """
        self.channel = channel
        if self._last is None:
            return False
        data, sequence, wall_ns = self._last
        file.add(channel, begin_ns, data, sequence, wall_ns)
        return True


class Track:
    """
    A topic of a session.

    :param stamp_offset: of the stamp in a message; None without one.
    :param shown: its bag topics; empty if it was not requested.
    :ivar kept: its channel for a replay; 0 if it has none.
    :ivar begin_ns: samples before this time were not requested.
    :ivar end_ns: samples after this time were not requested.
    :ivar not_before_ns: time of day at which the bag begins; older samples get this time.
    :ivar lost: number of lost samples.
    :ivar refused: number of samples that could not be converted.
    """

    __slots__ = ('name', 'outlets', 'kept', 'begin_ns', 'end_ns', 'not_before_ns', 'lost',
                 'refused', '_stamp_offset', '_line', '_next_seq', '_is_raw')

    def __init__(self, name: str, stamp_offset: int | None, line: StampLine,
                 shown: Sequence[ShownTopic] = ()) -> None:
        self.name = name
        self.outlets = tuple(map(Outlet, shown))
        self.kept = 0
        self.begin_ns = self.not_before_ns = 0
        self.end_ns = _FOREVER_NS
        self.lost = self.refused = 0
        self._is_raw = any(each.facts.core_topic for each in shown)
        self._stamp_offset = stamp_offset
        self._line = line
        self._next_seq = -1

    def write(self, file: BagFile, head: Header, cdr: bytearray) -> int:
        """
        Write a sample to its topics.

        :return: the number of messages in the bag.
        """
        wall_ns = self._line.wall_ns(head.stamp_ns)
        if self._stamp_offset is not None:
            _STAMP.pack_into(cdr, self._stamp_offset, *divmod(wall_ns, NS_PER_S))
        seq = head.seq
        if seq != self._next_seq and self._next_seq >= 0:
            self.lost += seq - self._next_seq
        self._next_seq = seq + 1
        seq &= 0xFFFFFFFF
        written = 0
        is_asked = self.outlets and self.begin_ns <= head.stamp_ns <= self.end_ns
        if is_asked:
            log_ns = max(wall_ns, self.not_before_ns)
            for outlet in self.outlets:
                written += outlet.write(file, log_ns, cdr, seq, wall_ns)
            self.refused += len(self.outlets) - written
        if self.kept and not (is_asked and self._is_raw):
            file.keep(self.kept, wall_ns, cdr, seq)
        return written

    def begin(self, file: BagFile, channels: dict[TopicFacts, int], begin_ns: int) -> int:
        """
        Continue in another file.

        :param channels: of the file, by topic; missing ones are added.
        :param begin_ns: time of day at which the file begins.
        :return: the number of messages of latched topics at its beginning.
        """
        repeated = 0
        for outlet in self.outlets:
            channel = channels.get(outlet.facts)
            if channel is None:
                channel = channels[outlet.facts] = file.channel(outlet.facts)
            repeated += outlet.begin(file, channel, begin_ns)
        return repeated
