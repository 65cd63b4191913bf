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


"""Answers of many packets: made as the client takes them, and none is lost."""

from __future__ import annotations

from collections.abc import Iterator
import queue
import socket
from typing import Any

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest

from rt_robot_os.base.errors import LinkError
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.link.entry_times import EntryTimes
from rt_robot_os.link.protocol import decode_json
from rt_robot_os.link.protocol import encode_json
from rt_robot_os.link.protocol import PacketKind
from rt_robot_os.link.protocol import PART_BYTES
from rt_robot_os.link.reader import Reader
from rt_robot_os.link.session import ClientSession
from rt_robot_os.link.session import OUTBOX_MAXIMUM
from rt_robot_os.link.session import STREAMS_MAXIMUM
from rt_robot_os.topics import Bus

PACKETS = OUTBOX_MAXIMUM + 500


class Ends:
    """A session and the client's end of its socket."""

    def __init__(self) -> None:
        ours, self.client = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        for one in (ours, self.client):
            one.setblocking(False)
        self.session = ClientSession(ours, Bus(Kernel(VirtualClock())), 1, 0, bytearray(100),
                                     EntryTimes(VirtualClock()))
        self.made = 0

    def packets(self) -> Iterator[bytes]:
        for number in range(PACKETS):
            self.made += 1
            yield number.to_bytes(400, 'little')

    def take(self, most: int = PACKETS) -> list[bytes]:
        taken: list[bytes] = []
        try:
            while len(taken) < most:
                taken.append(self.client.recv(1000))
        except BlockingIOError:
            pass
        return taken

    def close(self) -> None:
        self.session.close()
        self.client.close()


@settings(max_examples=20, deadline=None)
@given(st.lists(st.integers(1, 700), min_size=1, max_size=5))
def test_every_packet_comes_in_order_at_the_pace_of_the_client(steps: list[int]) -> None:
    ends = Ends()
    try:
        ends.session.post_all(ends.packets())
        taken: list[bytes] = []
        while len(taken) < PACKETS:
            assert ends.made < PACKETS or len(taken) > 0
            taken += ends.take(steps[len(taken) % len(steps)])
            ends.session.flush()
        assert [int.from_bytes(packet, 'little') for packet in taken] == list(range(PACKETS))
        assert ends.session.outbox_dropped == 0
    finally:
        ends.close()


def test_a_second_long_answer_comes_after_the_first_and_their_number_is_bounded() -> None:
    ends = Ends()
    try:
        ends.session.post_all(ends.packets())
        for number in range(STREAMS_MAXIMUM - 1):
            ends.session.post_all(iter([b'next %d' % number]))
        with pytest.raises(LinkError, match='still being sent'):
            ends.session.post_all(iter([b'x']))
        ends.session.post(b'short')  # what is short comes between
        taken: list[bytes] = []
        while len(taken) < PACKETS + STREAMS_MAXIMUM:
            taken += ends.take()
            ends.session.flush()
        assert b'short' in taken[:-STREAMS_MAXIMUM]
        assert taken[-STREAMS_MAXIMUM + 1:] == [
            b'next %d' % number for number in range(STREAMS_MAXIMUM - 1)]
        ends.session.post_all(iter([b'x']))
        assert ends.take() == [b'x']
    finally:
        ends.close()


def test_nothing_is_made_for_a_client_that_does_not_read() -> None:
    ends = Ends()
    try:
        ends.session.post_all(ends.packets())
        made = ends.made
        for _ in range(10):
            ends.session.flush()
        assert made == ends.made < PACKETS
    finally:
        ends.close()


@pytest.mark.parametrize('size', [1, PART_BYTES - 100, 5 * PART_BYTES, 300_000, 1_000_000])
def test_an_answer_of_any_length_arrives_whole(size: int) -> None:
    """One packet of a long answer would not fit the socket: the client would be parted with."""
    here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    here.setblocking(False)
    there.setblocking(False)
    client = Reader(there)
    replies: queue.SimpleQueue[Any] = queue.SimpleQueue()
    client.replies[7] = replies
    session = ClientSession(here, Bus(Kernel(VirtualClock())), 1, 0, bytearray(100),
                            EntryTimes(VirtualClock()))
    content = {'text': 'x' * size, 'list': list(range(100))}
    try:
        session.post(encode_json(PacketKind.REPLY, content, seq=7))
        while replies.empty():
            client.pump(0.0)
            session.flush()
            assert not session.gone
        head, packet = replies.get_nowait()
        assert decode_json(packet) == content and head.channel == 0
        assert session.outbox_dropped == 0 and replies.empty()
    finally:
        session.close()
        client.close()
