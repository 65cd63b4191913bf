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
import socket

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest

from rt_robot_os.errors import LinkError
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.link.session import OUTBOX_MAXIMUM
from rt_robot_os.link.session import Session
from rt_robot_os.topics import Bus

PACKETS = OUTBOX_MAXIMUM + 500


class Ends:
    """A session and the client's end of its socket."""

    def __init__(self) -> None:
        ours, self.client = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        for one in (ours, self.client):
            one.setblocking(False)
        self.session = Session(ours, Bus(Kernel(VirtualClock())), 1, 0, bytearray(100))
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


def test_a_second_long_answer_waits_for_the_end_of_the_first() -> None:
    ends = Ends()
    try:
        ends.session.post_all(ends.packets())
        with pytest.raises(LinkError, match='still on its way'):
            ends.session.post_all(iter([b'x']))
        ends.session.post(b'short')  # what is short comes between
        taken: list[bytes] = []
        while len(taken) < PACKETS + 1:
            taken += ends.take()
            ends.session.flush()
        assert b'short' in taken[:-1]
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
