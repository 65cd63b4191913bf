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

"""Does the dialogue with a RoboClaw come through lost, late and wrong answers, one at a time."""

from __future__ import annotations

from collections.abc import Iterator

from hypothesis import given
from hypothesis import strategies as st
import pytest
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.devices.roboclaw import wire
from rt_robot_os.devices.roboclaw.exchange import MOST_WAITING
from rt_robot_os.devices.roboclaw.exchange import RequestQueue
from rt_robot_os.devices.roboclaw.exchange import TRIES
from rt_robot_os.devices.roboclaw.simulated_unit import SimulatedUnit
from rt_robot_os.devices.roboclaw.wire import RoboClawDecoder

ADDRESS = 0x80
ENCODERS = wire.ask(ADDRESS, wire.ENCODERS)
BATTERY = wire.ask(ADDRESS, wire.MAIN_BATTERY)
STOP = wire.duty(ADDRESS, 0, 0)


class Bench:
    """An exchange with a unit, whose answers a test may spoil."""

    def __init__(self) -> None:
        self.decoder = RoboClawDecoder()
        self.exchange = RequestQueue(self.decoder, 30 * NS_PER_MS)
        self.unit = SimulatedUnit(ADDRESS, 'USB Roboclaw 2x15a v4.2.4', False)
        self.now_ns = 10**9
        self.sent: list[bytes] = []
        self.answers: list[wire.RoboClawReply] = []

    def send(self, data: bytes) -> bytes:
        self.sent.append(data)
        return self.unit.handle_command(data, self.now_ns)

    def hear(self, data: bytes) -> None:
        for reply in self.decoder.feed(data):
            self.exchange.answered()
            self.answers.append(reply)

    def run(self, milliseconds: int, spoil: Iterator[bool] | None = None) -> None:
        for _ in range(milliseconds):
            self.now_ns += NS_PER_MS
            data = self.exchange.due(self.now_ns)
            if data:
                answer = self.send(data)
                self.hear(answer if spoil is None or not next(spoil) else answer[1:])


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_requests_go_one_after_the_other(bench: Bench) -> None:
    for request in (STOP, ENCODERS, BATTERY):
        bench.exchange.add(lambda request=request: request)
    assert bench.exchange.due(0) == STOP.data
    assert bench.exchange.due(1) == b'', 'the answer is not there yet'
    bench.hear(wire.ACKNOWLEDGED)
    bench.run(10)
    assert [r.request for r in bench.answers] == [STOP, ENCODERS, BATTERY]
    assert bench.exchange.is_idle


def test_what_gets_no_answer_is_repeated_and_given_up(bench: Bench) -> None:
    bench.unit.address = 0x81
    bench.exchange.add(lambda: ENCODERS)
    bench.exchange.add(lambda: BATTERY)
    bench.run(1000)
    assert bench.sent == [ENCODERS.data] * TRIES + [BATTERY.data] * TRIES
    exchange = bench.exchange
    assert (exchange.timeouts, exchange.retries, exchange.given_up) == (6, 4, 2)
    assert exchange.is_idle


@given(spoiled=st.lists(st.booleans(), max_size=TRIES - 1))
def test_a_lost_byte_costs_a_repetition_and_no_mistake(spoiled: list[bool]) -> None:
    bench = Bench()
    bench.unit.counts = 1234, -256
    bench.exchange.add(lambda: ENCODERS)
    bench.run(300, iter([*spoiled, *[False] * 9]))
    counts = [wire.encoder_counts(r.data) for r in bench.answers]
    assert counts == [(1234, 2**32 - 256)]


def test_a_late_answer_is_not_taken_for_the_next_one(bench: Bench) -> None:
    bench.exchange.add(lambda: ENCODERS)
    bench.exchange.add(lambda: STOP)
    late = bench.unit.handle_command(bench.exchange.due(0), 0)
    assert bench.exchange.due(31 * NS_PER_MS) == b''
    bench.hear(late)
    assert bench.answers == [], 'it was given up'
    assert bench.exchange.due(40 * NS_PER_MS) == b'', 'the line is left alone'
    assert bench.exchange.due(47 * NS_PER_MS) == ENCODERS.data


def test_a_stop_does_not_wait(bench: Bench) -> None:
    bench.exchange.add(lambda: ENCODERS)
    first = bench.unit.handle_command(bench.exchange.due(10**9), 10**9)
    stop = bench.exchange.interrupt(lambda: STOP)
    assert stop == STOP.data
    # Its acknowledgement comes behind the answer that is on its way.
    bench.hear(first[:4])
    bench.hear(first[4:] + bench.send(stop))
    bench.run(200)
    assert [r.request for r in bench.answers] == [ENCODERS, STOP]
    assert bench.sent == [STOP.data], 'nothing was lost'
    assert bench.exchange.is_idle


def test_a_stop_behind_a_lost_answer_is_repeated_first(bench: Bench) -> None:
    bench.exchange.add(lambda: ENCODERS)
    first = bench.unit.handle_command(bench.exchange.due(10**9), 10**9)
    bench.hear(first[1:] + bench.send(bench.exchange.interrupt(lambda: STOP)))
    bench.run(200)
    assert [r.request for r in bench.answers] == [STOP, ENCODERS]
    assert bench.sent == [STOP.data, STOP.data, ENCODERS.data]


def test_stops_that_nobody_answers_are_no_end_of_them(bench: Bench) -> None:
    for _ in range(1000):
        assert bench.exchange.interrupt(lambda: STOP) == STOP.data
    assert bench.exchange.given_up >= 990
    bench.run(1000)
    assert bench.exchange.is_idle


def test_one_that_is_put_first_is_asked_once(bench: Bench) -> None:
    def battery() -> wire.RoboClawRequest:
        return BATTERY

    bench.exchange.add(lambda: ENCODERS)
    bench.exchange.add(battery)
    bench.exchange.put_first(battery)
    bench.run(10)
    assert [r.request for r in bench.answers] == [BATTERY, ENCODERS]


def test_one_that_is_always_put_first_starves_nothing(bench: Bench) -> None:
    def battery() -> wire.RoboClawRequest:
        return BATTERY

    for _ in range(3):
        bench.exchange.add(lambda: ENCODERS)
    for _ in range(6):
        bench.exchange.put_first(battery)
        bench.run(1)
    asked = [r.request for r in bench.answers]
    assert asked == [BATTERY, ENCODERS] * 3


def test_only_so_many_wait(bench: Bench) -> None:
    for _ in range(MOST_WAITING + 3):
        bench.exchange.add(lambda: ENCODERS)
    assert bench.exchange.given_up == 3


# --- the simulated unit --------------------------------------------------------------------------

def test_a_unit_forgets_half_a_request_after_a_pause() -> None:
    unit = SimulatedUnit(ADDRESS, 'x', False)
    data = wire.speeds(ADDRESS, 500, 500).data
    assert unit.handle_command(data[:5], 0) == b''
    assert unit.handle_command(data[5:], 5 * NS_PER_MS) == wire.ACKNOWLEDGED
    assert unit.handle_command(data[:5], 10**9) == b''
    assert unit.handle_command(data[5:], 10**9 + 11 * NS_PER_MS) == b''
    assert unit.handle_command(data, 2 * 10**9) == wire.ACKNOWLEDGED


def test_a_unit_refuses_a_wrong_crc_and_stops_when_nothing_comes() -> None:
    unit = SimulatedUnit(ADDRESS, 'x', False)
    data = wire.speeds(ADDRESS, 500, 500).data
    assert unit.handle_command(data[:-1] + bytes((data[-1] ^ 1,)), 0) == b''
    assert (unit.dropped, unit.drive.moves) == (1, False)
    unit.handle_command(wire.serial_timeout(ADDRESS, 0.5).data, 10**9)
    unit.handle_command(data, 10**9)
    unit.watch(10**9 + 500 * NS_PER_MS)
    assert unit.drive.moves
    unit.watch(10**9 + 501 * NS_PER_MS)
    assert not unit.drive.moves


def test_a_counter_that_is_set_goes_on_from_there() -> None:
    unit = SimulatedUnit(ADDRESS, 'x', False)
    unit.counts = 10, -10
    unit.handle_command(wire.encoder(ADDRESS, wire.SET_ENCODER_2, 1 << 30).data, 0)
    unit.counts = 15, -15
    answer = unit.handle_command(ENCODERS.data, 0)
    assert wire.encoder_counts(answer[:-2]) == (15, (1 << 30) - 5)
