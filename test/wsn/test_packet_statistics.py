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


"""The truth of a simulation, and the file of frames that Wireshark reads."""

from __future__ import annotations

import io
import struct

from hypothesis import given
from hypothesis import strategies as st

from rt_robot_os.features.wsn.simulator.packet_statistics import Gap
from rt_robot_os.features.wsn.simulator.packet_statistics import PacketStatistics
from rt_robot_os.features.wsn.simulator.pcap import PcapWriter


def test_each_packet_counts_once_however_often_it_comes() -> None:
    statistics = PacketStatistics((1, 2))
    statistics.add_generated(1, b'a', 100)
    statistics.add_generated(1, b'b', 200)
    statistics.add_generated(2, b'a', 300)
    assert statistics.add_delivered(1, b'a', 150)
    assert not statistics.add_delivered(1, b'a', 160)
    assert not statistics.add_delivered(1, b'x', 170)
    assert not statistics.add_delivered(9, b'a', 170)
    assert (statistics.generated, statistics.delivered) == ({1: 2, 2: 1}, {1: 1, 2: 0})
    assert (statistics.duplicates, statistics.unknown) == (1, 2)
    assert list(statistics.latencies_ns) == [50]


def test_a_node_that_boots_again_makes_new_packets() -> None:
    statistics = PacketStatistics((1,))
    statistics.add_generated(1, b'0', 0)
    assert statistics.add_delivered(1, b'0', 5)
    statistics.add_generated(1, b'0', 1000)
    assert statistics.add_delivered(1, b'0', 1005)
    assert statistics.delivered == {1: 2}


def test_gaps_are_losses_in_a_row() -> None:
    statistics = PacketStatistics((1,))
    for index, came in enumerate('1100100011000'):
        statistics.add_generated(1, b'%d' % index, 10 * index)
        if came == '1':
            statistics.add_delivered(1, b'%d' % index, 10 * index + 1)
    assert statistics.gaps(3, 500) == [Gap(1, 50, 80, 3), Gap(1, 100, 500, 3)]
    assert len(statistics.gaps(1, 500)) == 3


@given(st.lists(st.booleans(), max_size=60))
def test_gaps_and_deliveries_are_all_packets(fates: list[bool]) -> None:
    statistics = PacketStatistics((1,))
    for index, came in enumerate(fates):
        statistics.add_generated(1, b'%d' % index, index)
        if came:
            statistics.add_delivered(1, b'%d' % index, index)
    lost = sum(gap.lost for gap in statistics.gaps(1, len(fates)))
    assert lost == len(fates) - statistics.delivered[1]
    assert [took_ns == 0 for _, _, took_ns in statistics.fates()] == fates


def test_a_file_of_frames_is_a_pcap_file() -> None:
    for with_fcs, link_type, more in ((True, 195, b'\x31\xa4'), (False, 230, b'')):
        file = io.BytesIO()
        writer = PcapWriter(file, with_fcs)
        writer.write(3_000_000_007, b'\x02\x00\x01\x31\xa4')
        data = file.getvalue()
        assert struct.unpack('<IHHiIII', data[:24]) == (0xA1B23C4D, 2, 4, 0, 0, 127, link_type)
        size = 3 + len(more)
        assert struct.unpack('<IIII', data[24:40]) == (3, 7, size, size)
        assert data[40:] == b'\x02\x00\x01' + more
        assert writer.frames == 1
