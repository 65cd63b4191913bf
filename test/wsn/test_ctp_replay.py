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
The Collection Tree Protocol, step by step against what real motes sent.

Each mote of a recording is replayed alone: our protocol is given what the mote received and which
of its packets were acknowledged, and each beacon and data packet that it sends must equal the
mote's byte for byte: parent, ETX, what it says of its neighbours, and to whom data go.
"""

from __future__ import annotations

import csv
from functools import cache
import gzip
from pathlib import Path
from typing import NamedTuple

from fake_node import FakeNode
import pytest
from rt_robot_os.features.wsn.packets.ctp import CtpBeacon
from rt_robot_os.features.wsn.packets.ctp import CtpData
from rt_robot_os.features.wsn.routing.ctp import Ctp
from rt_robot_os.features.wsn.routing.protocol import BROADCAST
from rt_robot_os.features.wsn.routing.protocol import Received

# When the motes began, by the root's first line on the serial port.
START_US = 4_267_000
# A frame is written so long before it is on the air at most: the random wait for the channel.
BACKOFF_US = 12_000
# The recorder says that these were received, but the mote was not yet on, or sent at that time:
# what it tells of its neighbours in the first second shows it. By mote, times in us.
UNHEARD = {
    'chain4': {1: (4593022,), 2: (4430068,)},
    'lossy4': {1: (4593022,), 2: (4375363, 4430068)},
}


class Frame(NamedTuple):
    """A frame on the air."""

    at_us: int
    source: int
    destination: int
    am_type: int
    payload: bytes
    heard_by: frozenset[int]


@cache
def frames(path: Path) -> tuple[Frame, ...]:
    """Read a recording, without acknowledgements."""
    with gzip.open(path, 'rt') as lines:
        rows = [(row, bytes.fromhex(row['mpdu_hex_with_length_byte']))
                for row in csv.DictReader(lines)]
    return tuple([
        Frame(int(row['t_us']), int(row['source']), int.from_bytes(mpdu[6:8], 'little'), mpdu[11],
              mpdu[12:-2], frozenset(map(int, row['received_by'].split())))
        for row, mpdu in rows if mpdu[0] != 5])


class Replay:
    """One mote of a recording, and what our protocol does in its place."""

    def __init__(self, recorded: tuple[Frame, ...], address: int, unheard: tuple[int, ...],
                 written_early: frozenset[int] = frozenset()) -> None:
        self.node = FakeNode(address)
        self.router = Ctp(self.node, address == 0)
        self.sent = 0
        self.wrong: list[Frame] = []
        self._trickle, self._think, self._retry = self.node.timers
        self._beacon, self._data = self.node.senders
        self.router.start()
        self._run([frame for frame in recorded
                   if frame.source == address or
                   address in frame.heard_by and frame.at_us not in unheard], written_early)

    def _run(self, frames: list[Frame], written_early: frozenset[int]) -> None:
        me = self.node.address
        done: set[int] = set()
        for index, frame in enumerate(frames):
            for later in frames[index:index + 5]:
                if (later.at_us in written_early and later.at_us not in done and
                        later.at_us - frame.at_us < BACKOFF_US):
                    done.add(later.at_us)
                    self._write(later)
            if frame.source != me:
                self._hear(frame)
            elif frame.am_type == CtpBeacon.AM_TYPE:
                if frame.at_us not in done:
                    self._send_beacon(frame)
            else:
                self._send_data(frame, frames[index + 1:index + 40])

    def _hear(self, frame: Frame) -> None:
        got = Received(frame.destination, frame.source, frame.am_type, frame.payload, 100, -80)
        if frame.destination in (self.node.address, BROADCAST):
            self.router.receive(got)
        else:
            self.router.snoop(got)

    def _write(self, frame: Frame) -> None:
        if frame.am_type == CtpBeacon.AM_TYPE:
            self._send_beacon(frame)
        else:
            self.router.originate(CtpData.unpack(frame.payload).application)

    def _compare(self, frame: Frame, destination: int, payload: bytes) -> None:
        self.sent += 1
        if (destination, payload) != (frame.destination, frame.payload):
            self.wrong.append(frame)

    def _think_until(self, at_us: int) -> None:
        until_ns = (at_us - START_US) * 1000
        while self._think.due_ns is not None and self._think.due_ns <= until_ns:
            self._think.fire()

    def _send_beacon(self, frame: Frame) -> None:
        self._think_until(frame.at_us)
        while self._beacon.frame is None:
            self._trickle.fire()
        sent = self._beacon.done()
        self._compare(frame, sent.destination, sent.payload)

    def _send_data(self, frame: Frame, later: list[Frame]) -> None:
        self._think_until(frame.at_us)
        data = CtpData.unpack(frame.payload)
        if self._data.frame is None and data.origin == self.node.address:
            self.router.originate(data.application)
        if self._data.frame is None and self._retry.due_ns is not None:
            self._retry.fire()
        assert self._data.frame is not None, f'nothing to send at {frame.at_us} us: {data}'
        self._compare(frame, self._data.frame.destination, self._data.frame.payload)
        # Whether the acknowledgement came in, the mote tells by not sending the packet again.
        following = [CtpData.unpack(one.payload) for one in later
                     if one.source == self.node.address and one.am_type == CtpData.AM_TYPE][:1]
        again = [one for one in following if one[3:5] == data[3:5] and one.hops == data.hops]
        self._data.done(acknowledged=not again)


@pytest.mark.parametrize(('name', 'address', 'sent'), [
    ('chain4', 0, 15), ('chain4', 1, 176), ('chain4', 2, 231), ('chain4', 3, 180),
    ('lossy4', 0, 16), ('lossy4', 1, 646), ('lossy4', 2, 438), ('lossy4', 3, 345),
])
def test_every_frame_is_what_the_mote_sent(data_dir: Path, name: str, address: int,
                                           sent: int) -> None:
    recorded = frames(data_dir / 'wsn' / f'mspsim_{name}_ctp.air.csv.gz')
    unheard = UNHEARD[name].get(address, ())
    first = Replay(recorded, address, unheard)
    # A frame that waits for the channel does not know what came in meanwhile.
    early = frozenset([frame.at_us for frame in first.wrong
                       if frame.am_type == CtpBeacon.AM_TYPE or
                       CtpData.unpack(frame.payload).origin == address])
    assert len(early) <= 2
    replay = Replay(recorded, address, unheard, early)
    assert replay.wrong == []
    assert replay.sent == sent


@pytest.mark.parametrize(('name', 'unique', 'duplicates'), [
    ('chain4', 354, 14), ('lossy4', 534, 34),
])
def test_the_root_hands_over_what_the_serial_line_had(data_dir: Path, name: str, unique: int,
                                                      duplicates: int) -> None:
    recorded = frames(data_dir / 'wsn' / f'mspsim_{name}_ctp.air.csv.gz')
    delivered = Replay(recorded, 0, ()).node.delivered
    packets = {(one.origin, one.payload[6]) for one in delivered}
    assert len(packets) == unique
    assert len(delivered) - len(packets) == duplicates


@pytest.mark.parametrize('name', ['chain4', 'lossy4'])
def test_the_root_delivers_what_its_debug_frames_tell(data_dir: Path, name: str) -> None:
    """Debug frames 0x21 on the serial line: sequence number, origin and hops of what came in."""
    wsn = data_dir / 'wsn'
    recorded = frames(wsn / f'mspsim_{name}_ctp.air.csv.gz')
    delivered = Replay(recorded, 0, ()).node.delivered
    with gzip.open(wsn / f'mspsim_{name}_ctp.frames.csv.gz', 'rt') as lines:
        serial = [bytes.fromhex(row['frame_hex_unescaped_with_crc'])[1:-2]
                  for row in csv.DictReader(lines)]
    debug = [packet[8:] for packet in serial if packet[7] == 0x72]
    told = [(one[2], one[4], one[6]) for one in debug if one[0] == 0x21]
    assert told == [(one.payload[6], one.origin, one.payload[1]) for one in delivered]
    # The root is its own parent from the start, and tells of each of its beacons.
    assert [one[1:6] for one in debug if one[0] == 0x31] == [bytes(5)]
    beacons = [frame for frame in recorded
               if frame.source == 0 and frame.am_type == CtpBeacon.AM_TYPE]
    assert len([one for one in debug if one[0] == 0x33]) == len(beacons)
    # Its own packets, 0x20, go to itself at once; after each wait the queue is empty, 0x50, and
    # so it was when the route to itself was found.
    own = [one[2] for one in debug if one[0] == 0x20]
    assert len([one for one in debug if one[0] == 0x50]) == len(own) + 1
    root = FakeNode(0)
    router = Ctp(root, True)
    router.start()
    for _ in own:
        assert router.originate(b'hello')
        root.run_binary_ms(14)
    assert [one.payload[6] for one in root.delivered] == own
