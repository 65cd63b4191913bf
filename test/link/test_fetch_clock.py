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

"""A client that reads on its own clock: when, what wakes it nevertheless, what it loses."""

from __future__ import annotations

from collections.abc import Iterator
import socket

from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
import pytest

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.link import fetch_clock
from rt_robot_os.link.fetch_clock import FetchClock

HOUR_NS = 3_600_000_000_000
# What the smallest socket buffer of Linux's defaults holds.
SOCKET_BYTES = 208 << 10

Pair = tuple[socket.socket, socket.socket]


@pytest.fixture
def ends() -> Iterator[Pair]:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours, theirs:
        yield ours, theirs


def unhurried(connection: socket.socket) -> FetchClock:
    """Make a clock whose next moment is far away."""
    clock = FetchClock(connection)
    clock.interval_ns = HOUR_NS
    while clock.left_ns() < HOUR_NS // 2:
        clock.fetched(0)
    return clock


def test_a_packet_wakes_nobody_and_the_end_of_the_connection_does(ends: Pair) -> None:
    ours, theirs = ends
    clock = unhurried(ours)
    theirs.send(b'a sample')
    assert not clock.wait(0.02)
    theirs.close()
    assert clock.wait(60.0), 'the core has ended'


def test_a_shorter_interval_counts_at_once(ends: Pair) -> None:
    clock = unhurried(ends[0])
    clock.interval_ns = NS_PER_MS
    assert clock.wait(60.0)


class _Time:
    """A clock that stands still between the steps of a test."""

    now_ns = HOUR_NS

    def monotonic_ns(self) -> int:
        return self.now_ns


@examples(max_examples=100)
@given(st.integers(1, 100), st.integers(0, 20_000_000), st.integers(0, NS_PER_MS))
def test_what_comes_meanwhile_fits_the_socket_and_nothing_waits_longer_than_allowed(
        interval_ms: int, bytes_per_s: int, late_ns: int) -> None:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    time = _Time()
    with ours, theirs, pytest.MonkeyPatch.context() as patch:
        patch.setattr(fetch_clock, 'time', time)
        clock = FetchClock(ours)
        clock.interval_ns = interval_ms * NS_PER_MS
        waits_ns = []
        for _ in range(20):
            wait_ns = max(0, clock.left_ns()) + late_ns
            time.now_ns += wait_ns
            came = bytes_per_s * wait_ns // 1_000_000_000
            assert came <= SOCKET_BYTES / 2
            clock.fetched(came)
            waits_ns.append(wait_ns)
        assert max(waits_ns) <= clock.interval_ns + late_ns
        if bytes_per_s < 100_000:
            assert waits_ns[-1] == clock.interval_ns + late_ns
