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

"""What a client sends ages while it waits, also while the machine is suspended."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
import socket
from types import SimpleNamespace
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import pytest

from rt_robot_os.kernel import VirtualClock
from rt_robot_os.link import client as client_module
from rt_robot_os.link import LinkClient
from rt_robot_os.link.entry_times import EntryTimes
from rt_robot_os.link.protocol import encode_json
from rt_robot_os.link.protocol import PacketKind
from rt_robot_os.link.protocol import parse_header

MS = 1_000_000
S = 1_000_000_000


class Sleepy:
    """The clock of a machine that is suspended."""

    slept_ns = 0

    def suspended_ns(self) -> int:
        return self.slept_ns


def entries_of(clock: Sleepy) -> EntryTimes:
    return EntryTimes(clock)  # type: ignore[arg-type]


def test_what_waited_while_the_machine_was_suspended_is_older_than_its_stamp() -> None:
    clock = Sleepy()
    entries = entries_of(clock)
    clock.slept_ns = 60 * S
    entries.update(100 * S)
    assert entries.stamp_of(100 * S - 1, 101 * S) == 40 * S - 1
    assert entries.stamp_of(100 * S + 1, 101 * S) == 100 * S + 1, 'sent afterwards'
    assert entries.stamp_of(5 * S, 101 * S) == 1, 'not a time before the clock began'
    assert entries.suspensions == 1


def test_the_time_between_two_readings_of_the_clocks_is_no_suspension() -> None:
    clock = Sleepy()
    entries = entries_of(clock)
    for step in (300, -200, 40 * MS):
        clock.slept_ns += step
        entries.update(S)
    assert entries.suspensions == 0 and entries.stamp_of(S - 1, S) == S - 1


@given(st.integers(-(1 << 63), (1 << 63) - 1), st.integers(1, 1 << 62), st.integers(0, 1 << 62))
def test_no_stamp_is_in_the_future_or_younger_than_the_client_said(
        stamp_ns: int, now_ns: int, slept_ns: int) -> None:
    clock = Sleepy()
    entries = entries_of(clock)
    clock.slept_ns = slept_ns
    entries.update(now_ns)
    found = entries.stamp_of(stamp_ns, now_ns)
    assert 0 <= found <= now_ns
    if 0 < stamp_ns <= now_ns:
        assert 0 < found <= stamp_ns


def test_a_clock_that_cannot_be_suspended_says_so() -> None:
    assert VirtualClock().suspended_ns() == 0


@contextmanager
def connected(folder: Path) -> Iterator[tuple[LinkClient, socket.socket]]:
    """Give a client and the far end of its socket, where no core reads."""
    path = folder / 's'
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listener:
        listener.bind(str(path))
        listener.listen(1)
        real = LinkClient.request

        def hello(self: LinkClient, do: str, **arguments: Any) -> dict[str, Any]:
            return {'topics': []}
        LinkClient.request = hello  # type: ignore[method-assign]
        try:
            client = LinkClient(path)
        finally:
            LinkClient.request = real  # type: ignore[method-assign]
        far, _ = listener.accept()
        with client, far:
            yield client, far


def test_a_sample_without_a_stamp_has_that_of_the_moment_at_which_it_was_sent(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with connected(tmp_path) as (client, far):
        times = iter((7 * S, 8 * S))
        monkeypatch.setattr(client_module, 'time', SimpleNamespace(
            monotonic_ns=lambda: next(times), monotonic=lambda: 0.0))
        client.publish(3, b'first')
        client.publish(3, b'second', 5 * S)
        client.publish(3, b'third')
        stamps = [parse_header(memoryview(far.recv(100))).stamp_ns for _ in range(3)]
    assert stamps == [7 * S, 5 * S, 8 * S]


def test_a_request_has_no_stamp_to_age() -> None:
    assert parse_header(memoryview(encode_json(PacketKind.REQUEST, {'id': 1}))).stamp_ns == 0
