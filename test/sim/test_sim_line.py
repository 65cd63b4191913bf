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


"""Do bytes leave a simulated line at the speed of a real one."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from rt_robot_os.sim.line import at_wrong_speed
from rt_robot_os.sim.line import LineTiming

BYTE_NS = 10 * 10**9 // 9600


def test_each_byte_takes_ten_bits() -> None:
    line = LineTiming(9600)
    assert line.push(b'abc', 1000)
    assert line.take(1000 + BYTE_NS - 1) == b''
    assert line.take(1000 + BYTE_NS) == b'a'
    assert line.take(1000 + 3 * BYTE_NS) == b'bc'
    assert line.next_ns() is None


def test_what_is_pushed_while_the_line_is_busy_follows_without_a_gap() -> None:
    line = LineTiming(9600)
    line.push(b'ab', 0)
    line.push(b'cd', 10)
    assert line.take(4 * BYTE_NS - 1) == b'abc'
    assert line.take(4 * BYTE_NS) == b'd'


def test_an_idle_line_begins_when_the_next_is_due() -> None:
    line = LineTiming(9600)
    line.push(b'a', 0)
    line.take(10**9)
    line.push(b'b', 10**10)
    assert line.take(10**10) == b''
    assert line.take(10**10 + BYTE_NS) == b'b'


def test_a_full_line_takes_all_or_nothing() -> None:
    line = LineTiming(9600, capacity=4)
    assert line.push(b'abc', 0)
    assert not line.push(b'de', 0)
    assert line.push(b'd', 0)
    assert line.take(10**9) == b'abcd'
    assert line.waiting == 0


def test_without_a_speed_everything_leaves_when_it_is_due() -> None:
    line = LineTiming(0)
    line.push(b'abc', 5)
    assert line.take(4) == b''
    assert line.take(5) == b'abc'


@given(pieces=st.lists(st.tuples(st.binary(max_size=40), st.integers(0, 10**8)), max_size=20),
       steps=st.lists(st.integers(1, 3 * 10**7), max_size=60),
       baud=st.sampled_from([0, 9600, 115200, 921600]))
def test_no_byte_is_lost_or_early_and_the_line_says_when_to_come_back(
    pieces: list[tuple[bytes, int]], steps: list[int], baud: int,
) -> None:
    line = LineTiming(baud)
    due = 0
    for data, gap in pieces:
        due += gap
        assert line.push(data, due)
    taken, now = b'', 0
    for step in steps:
        now += step
        taken += line.take(now)
        assert len(taken) * line.byte_ns <= now
    while (next_ns := line.next_ns()) is not None:
        got = line.take(next_ns)
        assert got or next_ns < now
        taken += got or line.take(max(now, next_ns))
    assert taken == b''.join(data for data, _ in pieces)


@given(data=st.binary(max_size=50))
def test_at_the_right_speed_every_byte_is_heard_as_it_is(data: bytes) -> None:
    assert at_wrong_speed(data, 1.0) == data


def test_what_is_heard_at_another_speed() -> None:
    # 0xFF is low for one bit only, too short for a start bit of half the speed.
    assert at_wrong_speed(b'\xff', 2.0) == b''
    # 0x00 is low for nine bits: start bit and three bits of the receiver, then ones.
    assert at_wrong_speed(b'\x00', 2.0) == b'\xf8'
    # Twice as fast each bit is heard twice, and a second byte begins where a low one does.
    assert at_wrong_speed(b'\x0f', 0.5)[:1] == b'\xfe'
    assert at_wrong_speed(b'', 2.0) == b''


@given(data=st.binary(max_size=50), factor=st.sampled_from([0.25, 0.5, 0.9, 1.1, 2.0, 6.0, 12.0]))
def test_hearing_ends_at_every_speed(data: bytes, factor: float) -> None:
    assert len(at_wrong_speed(data, factor)) <= len(data) * 10
