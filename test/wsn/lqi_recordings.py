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

"""Recordings of MultiHopLQI, and routers that are led through what happened in them."""

from __future__ import annotations

import csv
import gzip
from pathlib import Path
from typing import NamedTuple

from fake_node import FakeNode
from fake_node import FakeSender
from fake_node import Sent
from rt_robot_os.features.wsn.packets.multihop_lqi import LqiBeacon
from rt_robot_os.features.wsn.packets.multihop_lqi import LqiData
from rt_robot_os.features.wsn.routing.multihop_lqi import MultiHopLqi2
from rt_robot_os.features.wsn.routing.protocol import BROADCAST
from rt_robot_os.features.wsn.routing.protocol import Received

SHORTEST_DATA_BYTES = 12
#: Motes wait for an acknowledgement for 256/32768 s after the frame.
ACKNOWLEDGEMENT_US = 9000
BYTE_US = 32


class OnAir(NamedTuple):
    """A frame of a recording: MPDU with its length byte before."""

    time_us: int
    source: int
    mpdu: bytes
    heard_by: list[int]

    @property
    def is_acknowledgement(self) -> bool:
        """Tell it from a frame with data."""
        return len(self.mpdu) < SHORTEST_DATA_BYTES

    @property
    def sent(self) -> Sent:
        """Return what the node gave to its radio."""
        mpdu = self.mpdu
        return Sent(int.from_bytes(mpdu[6:8], 'little'), mpdu[11], mpdu[12:-2],
                    bool(mpdu[1] & 0x20))


def rows(path: Path) -> list[dict[str, str]]:
    """Read a table."""
    with gzip.open(path, 'rt') as file:
        return list(csv.DictReader(file))


def on_air(path: Path) -> list[OnAir]:
    """Read the frames that were on the air."""
    return [OnAir(int(row['t_us']), int(row['source']),
                  bytes.fromhex(row['mpdu_hex_with_length_byte']),
                  [int(node) for node in (row['received_by'] or '').split()])
            for row in rows(path)]


def links(path: Path) -> dict[tuple[int, int], tuple[int, int]]:
    """Read LQI and RSSI by sender and receiver."""
    found = {}
    for line in path.read_text().splitlines():
        source, to, _, rssi, lqi = line.split()
        found[int(source), int(to)] = int(lqi), int(rssi)
    return found


class Firmware:
    """
    Routers that are given what motes received, and asked what they send then.

    What is taken from the recording: when an application makes a packet, when a beacon's timer
    runs down, who receives a frame, and whether a sender saw its acknowledgement.

    :ivar unlike: frames that were on the air and that the routers would not have sent.
    :ivar unseen: acknowledgements that were received and that the mote did not take notice of:
        its radio's queue is blind for a while when frames overlap.
    """

    def __init__(self, frames: list[OnAir], lqi: dict[tuple[int, int], tuple[int, int]],
                 nodes: int, root: int = 0) -> None:
        self.nodes = [FakeNode(address, address) for address in range(nodes)]
        self.routers = [MultiHopLqi2(node, node.address == root) for node in self.nodes]
        self.unlike: list[tuple[OnAir, Sent | None]] = []
        self.explained = 0
        self.unseen = 0
        self._frames = frames
        self._links = lqi
        for router in self.routers:
            router.start()
        for number, frame in enumerate(frames):
            if not frame.is_acknowledgement:
                self._step(number, frame)

    def _step(self, number: int, frame: OnAir) -> None:
        sender = self._sender(frame)
        if sender.frame == frame.sent:
            self.explained += 1
        else:
            self.unlike.append((frame, sender.frame))
        for to in frame.heard_by:
            self._receive(frame, to)
        if sender.frame is not None:
            sender.done(self._acknowledged(number, frame))

    def _sender(self, frame: OnAir) -> FakeSender:
        node = self.nodes[frame.source]
        beacons, own, forwarding = node.senders
        sent = frame.sent
        if sent.am_type == LqiBeacon.AM_TYPE:
            node.timers[0].fire()
            return beacons
        data = LqiData.unpack(sent.payload)
        if data.origin != frame.source:
            return forwarding
        if not own.busy:
            self.routers[frame.source].originate(data.data)
        return own

    def _receive(self, frame: OnAir, to: int) -> None:
        sent = frame.sent
        lqi, rssi = self._links[frame.source, to]
        self.nodes[to].time_ns = frame.time_us * 1000
        if sent.destination in (to, BROADCAST):
            self.routers[to].receive(Received(sent.destination, frame.source, sent.am_type,
                                              sent.payload, lqi, rssi))

    def _acknowledged(self, number: int, frame: OnAir) -> bool:
        """Tell whether an acknowledgement came, and the mote did not send the same again."""
        until = frame.time_us + len(frame.mpdu) * BYTE_US + ACKNOWLEDGEMENT_US
        came = False
        for later in self._frames[number + 1:]:
            if later.is_acknowledgement:
                came = came or (later.time_us < until and frame.source in later.heard_by
                                and later.mpdu[3] == frame.mpdu[3]
                                and frame.sent.destination in (later.source, BROADCAST))
            elif later.source == frame.source and came and _same_path(frame, later):
                if later.sent.payload != frame.sent.payload:
                    return True
                self.unseen += 1
                return False
            elif later.time_us > until and not came:
                return False
        return came


def _same_path(frame: OnAir, later: OnAir) -> bool:
    """Tell whether both are data, and both forwarded or both the node's own."""
    one, other = frame.sent, later.sent
    if other.am_type != LqiData.AM_TYPE or one.am_type != LqiData.AM_TYPE:
        return False
    return ((LqiData.unpack(one.payload).origin == frame.source)
            == (LqiData.unpack(other.payload).origin == frame.source))
