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

"""Split a packet into its samples."""

from __future__ import annotations

from collections.abc import Iterator

from rt_robot_os.base.errors import LinkError
from rt_robot_os.link.protocol import HEADER_BYTES
from rt_robot_os.link.protocol import RECORD
from rt_robot_os.link.protocol import RECORD_HEAD

#: A sample of a packet: channel, samples missed, stamp in ns, number in its topic, CDR.
Record = tuple[int, int, int, int, memoryview]
_HEAD_BYTES = RECORD_HEAD.size


def records(packet: memoryview) -> Iterator[Record]:
    """
    Split a packet of samples.

    :raises LinkError: a length in the packet is wrong.
    """
    at, end = HEADER_BYTES, len(packet)
    while at < end:
        start = at + _HEAD_BYTES
        if start <= end:
            length, _, _, channel, missed, stamp_ns, seq = RECORD_HEAD.unpack_from(packet, at)
        else:
            length = 0
        at += RECORD.size + length
        if length < HEADER_BYTES or at > end:
            raise LinkError(f'a packet of {end} bytes holds a sample of {length} bytes that does '
                            f'not fit, at offset {start - _HEAD_BYTES}')
        yield channel, missed, stamp_ns, seq, packet[start:at]
        at += -length % 8
