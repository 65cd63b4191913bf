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

"""Corrections: framed, checked, counted and passed on; what is wrong with them is told."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from datetime import datetime
from datetime import timezone
from pathlib import Path
import select
import socket
import time
from typing import Any

from driver_fakes import bind
from driver_fakes import scripted
from driver_fakes import settings_of
from hypothesis import given
from hypothesis import strategies as st
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.logger import Logger
from rt_robot_os.devices.ublox import corrections
from rt_robot_os.devices.ublox import wire
from rt_robot_os.devices.ublox.corrections import RtcmCorrections
from rt_robot_os.devices.ublox.driver import Ublox
from rt_robot_os.devices.ublox.rtcm import crc24q
from rt_robot_os.devices.ublox.rtcm import message
from rt_robot_os.devices.ublox.rtcm import PartialCrc
from rt_robot_os.devices.ublox.rtcm import RtcmDecoder
from rt_robot_os.devices.ublox.simulated import SimulatedUblox
from rt_robot_os.sim.pty_port import PtyPort
from rt_robot_os.testing import DecoderContract
from rt_robot_os.testing import rig

S = 1_000_000_000
MS = 1_000_000
# A station's position, from the standard's own example; pyrtcm 1.1 agrees with its checksum.
STATION = bytes.fromhex('d300133ed7d30202980edeef34b4bd62ac0941986f33360b98')


class TestRtcmDecoder(DecoderContract):
    stream = STATION + message(1077, bytes(range(200))) + message(63, b'abc') + message(1230)
    tokens = (b'\xd3', b'\xd3\x00', b'\xd3\x03\xff', STATION, message(1087, b'x'),
              b'\xd3\x00\x00', b'\xd3\x00\x00' + crc24q(b'\xd3\x00\x00').to_bytes(3, 'big'))
    pending_limit = 1030

    def decoder(self) -> Any:
        return RtcmDecoder()

    def frame_size(self, frame: Any) -> int:
        return int(frame.size)


def test_the_messages_of_a_stream() -> None:
    decoder = RtcmDecoder()
    frames = decoder.feed(b'text' + STATION + message(1077, b'abc') + b'\xd3')
    assert [f.number for f in frames] == [1005, 1077]
    assert frames[0].data == STATION
    assert (decoder.rejected_bytes, decoder.pending_bytes) == (4, 1)


@pytest.mark.parametrize('number', [1, 63, 100, 1001, 1005, 1230, 1304, 4001, 4072, 4095])
def test_messages_of_all_numbers_in_use_are_found(number: int) -> None:
    """63 is an ephemeris of BeiDou, which base stations send under that experimental number."""
    decoder = RtcmDecoder()
    frames = decoder.feed(STATION + message(number, bytes(50)) + STATION)
    assert [frame.number for frame in frames] == [1005, number, 1005]
    assert decoder.rejected_bytes == 0


@given(st.binary(max_size=300), st.integers(0, 300), st.integers(0, 300))
def test_the_checksum_of_a_part_is_that_of_its_bytes(data: bytes, one: int, other: int) -> None:
    begin, end = sorted((min(one, len(data)), min(other, len(data))))
    partial = PartialCrc()
    for _ in range(2):
        assert partial.of(data, begin, end) == crc24q(data[begin:end])


# --- the source ----------------------------------------------------------------------------------

@pytest.fixture
def station() -> Iterator[socket.socket]:
    """Listen as a base station does."""
    with socket.create_server(('127.0.0.1', 0)) as listener:
        listener.settimeout(60)
        yield listener


def source(port: str) -> RtcmCorrections:
    return RtcmCorrections('gps', port, 0, Logger('gps'))


def maintain_until(made: RtcmCorrections, condition: Callable[[], bool], now_ns: int = S) -> None:
    deadline = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < deadline, made.problem
        made.maintain(now_ns)
        select.select([], [], [], 0.005)


def test_only_whole_messages_are_passed_on_and_all_is_counted(station: socket.socket) -> None:
    made = source(f'tcp://127.0.0.1:{station.getsockname()[1]}')
    assert made.report(S)['corrections'] == 'not opened yet'
    made.maintain(S)
    client = station.accept()[0]
    broken = bytearray(STATION)
    broken[9] ^= 1
    client.sendall(STATION + bytes(broken) + message(1077) * 2 + STATION[:10])
    maintain_until(made, lambda: made.numbers.total() == 3)
    assert [made.take() for _ in range(4)] == [STATION, message(1077), message(1077), b'']
    report = made.report(3 * S)
    assert report['corrections'] == 'coming' and report['corrections_age_s'] == 2.0
    assert report['corrections_messages'] == '1005: 1, 1077: 2'
    assert report['corrections_rejected_bytes'] == len(broken)
    made.close()
    client.close()


def test_a_source_that_ends_is_opened_again(station: socket.socket) -> None:
    made = source(f'tcp://127.0.0.1:{station.getsockname()[1]}')
    made.maintain(S)
    station.accept()[0].close()
    maintain_until(made, lambda: 'the other side closed the connection' in made.problem)
    made.maintain(S + corrections._RETRY_NS - 1)
    assert not select.select([station], [], [], 0)[0]
    made.maintain(S + corrections._RETRY_NS)
    client = station.accept()[0]
    client.sendall(STATION)
    maintain_until(made, lambda: made.problem == '', 3 * S)
    made.close()
    client.close()


def test_a_source_that_is_silent_or_sends_something_else_is_told(station: socket.socket) -> None:
    made = source(f'tcp://127.0.0.1:{station.getsockname()[1]}')
    made.maintain(S)
    client = station.accept()[0]
    client.sendall(b'$GPGGA,no,corrections*00\r\n' * 10)
    maintain_until(made, lambda: 'no RTCM 3 message for 30 s: check that' in made.problem, 40 * S)
    assert made.report(S)['corrections_rejected_bytes']
    made.close()
    client.close()


def test_what_nobody_takes_is_bounded_and_counted(station: socket.socket) -> None:
    made = source(f'tcp://127.0.0.1:{station.getsockname()[1]}')
    made.maintain(S)
    client = station.accept()[0]
    client.sendall(b''.join(message(1001 + i) for i in range(200)))
    maintain_until(made, lambda: made._decoder.frames == 200)
    report = made.report(S)
    assert report['corrections_dropped'] == 200 - 64
    assert len(made.numbers) <= 33 and made.numbers.total() == 200
    assert made.take() == message(1137)
    made.close()
    client.close()


def test_a_flood_is_looked_at_in_parts(station: socket.socket) -> None:
    made = source(f'tcp://127.0.0.1:{station.getsockname()[1]}')
    made.maintain(S)
    client = station.accept()[0]
    client.sendall(bytes(30_000) + STATION)
    seen = [0]
    while not made.numbers:
        made.maintain(S)
        seen.append(made._decoder.rejected_bytes)
    assert max(b - a for a, b in zip(seen, seen[1:])) <= 8192
    assert seen[-1] == 30_000
    made.close()
    client.close()


def test_a_caster_is_asked_for_its_mount_point(station: socket.socket) -> None:
    number = station.getsockname()[1]
    made = source(f'ntrip://me:se%20cret@127.0.0.1:{number}/BASE')
    made.maintain(S)
    client = station.accept()[0]
    client.settimeout(60)
    asked = b''
    while b'\r\n\r\n' not in asked:
        asked += client.recv(1000)
    assert asked.startswith(b'GET /BASE HTTP/1.0\r\nUser-Agent: NTRIP ')
    assert b'\r\nAuthorization: Basic bWU6c2UgY3JldA==\r\n' in asked
    client.sendall(b'ICY 200 OK\r\n\r\n' + STATION)
    maintain_until(made, lambda: made.problem == '')
    assert made.take() == STATION
    made.close()
    client.close()


def test_a_caster_is_told_where_the_receiver_is(station: socket.socket) -> None:
    port = f'ntrip://127.0.0.1:{station.getsockname()[1]}/NEAREST'
    noon = datetime(2026, 1, 1, 12, tzinfo=timezone.utc)
    with scripted(Ublox, [wire.make_nav_pvt(noon, 52.5, 13.25, 81.0, separation_m=40.0)],
                  corrections=port) as (device, _):
        made = device._corrections
        made.maintain(S)
        client = station.accept()[0]
        client.settimeout(60)
        client.sendall(b'ICY 200 OK\r\n\r\n')
        maintain_until(made, lambda: made._head != b'')
        assert made._position() == b''  # not known yet
        device.read(S)
        made.maintain(S)
        told = b''
        while not told.endswith(b'\r\n') or b'GPGGA' not in told:
            told += client.recv(1000)
        assert b'$GPGGA,120000' in told
        assert b',5230.0000' in told and b',01315.0000' in told and b',41.00,M,40.0,M' in told
        for now_ns in range(2 * S, 11 * S, S):
            made.maintain(now_ns)
        assert not select.select([client], [], [], 0)[0]
        made.maintain(11 * S)
        assert b'GPGGA' in client.recv(1000)
        client.close()


@pytest.mark.parametrize('answer, said', [
    (b'HTTP/1.0 401 Unauthorized\r\n\r\n', "answers '401': check user and password"),
    (b'HTTP/1.1 404 Not Found\r\n\r\n', "answers '404': check the mount point"),
    (b'SOURCETABLE 200 OK\r\n', 'no such mount point')])
def test_what_a_caster_refuses_is_told_without_the_password(
        station: socket.socket, answer: bytes, said: str) -> None:
    made = source(f'ntrip://me:secret@127.0.0.1:{station.getsockname()[1]}/BASE')
    made.maintain(S)
    client = station.accept()[0]
    client.sendall(answer)
    maintain_until(made, lambda: said in made.problem)
    assert 'secret' not in made.problem and '/BASE: ' in made.problem
    made.close()
    client.close()


@pytest.mark.parametrize('port', ['ntrip://host', 'ntrip://:2101/X', 'ntrip://a:b@h:x/M',
                                  'ntrip://h/A B', 'ntrip://h/A\r\nX', 'tcp://host', 'http://a:1'])
def test_a_wrong_source_is_found_with_the_configuration(port: str) -> None:
    with pytest.raises(ConfigError, match='gps.corrections .*(must look like|must be a path)'):
        Ublox('gps', settings_of(Ublox, port='/dev/x', corrections=port))


# --- the receiver --------------------------------------------------------------------------------

def test_a_receiver_gets_an_rtk_solution_from_a_station_on_a_serial_line(tmp_path: Path) -> None:
    radio = PtyPort(tmp_path / 'radio')
    radio.plug()
    with rig(tmp_path, SimulatedUblox, Ublox, configure=True, output_rate_hz=5.0,
             corrections=str(radio.link), corrections_baud=0) as made:
        def each(now_ns: int) -> None:
            if now_ns % (20 * MS) == 0:
                made.device.write(now_ns)
            if now_ns % (50 * MS) == 0:
                made.device.maintain(now_ns)
            if now_ns % (1000 * MS) == 0:
                radio.write(STATION + message(1077, bytes(100)))

        made.device.clock_ns = lambda: made.now_ns
        made.run(4000, each=each)
        deadline = time.monotonic() + 60
        while not made.simulated.corrections or made.publishers[0].samples[-1].status.status != 2:
            assert time.monotonic() < deadline
            made.run(50, each=each)  # a pty hands over in its own time
        more = made.device.statistics().more
        assert more['corrections'] == 'coming' and '1005: ' in more['corrections_messages']
        assert 0 <= more['corrections_age_s'] < 3600
    radio.unplug()


def test_a_source_that_is_away_is_no_fault_of_the_receiver(tmp_path: Path) -> None:
    with rig(tmp_path, SimulatedUblox, Ublox, output_rate_hz=5.0,
             corrections=str(tmp_path / 'none')) as made:
        made.run(1000, each=made.device.maintain)
        assert made.publishers[0].samples
        assert 'does not exist' in made.device.statistics().more['corrections']


def test_a_replay_asks_nobody_for_corrections(station: socket.socket) -> None:
    port = f'tcp://127.0.0.1:{station.getsockname()[1]}'
    with scripted(Ublox, [b''] * 3, corrections=port) as (device, _):
        for now_ns in range(3):
            device.maintain(now_ns)
            device.write(now_ns)
        assert not device._port.written
    assert not select.select([station], [], [], 0.05)[0]


def test_the_counters_of_a_receiver_without_corrections_are_as_before() -> None:
    device = Ublox('gps', settings_of(Ublox, port='x'))
    bind(device)
    assert device.statistics().more == {}
