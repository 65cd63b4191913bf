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


"""Does the player play a log as it was: its bytes, its speed or its times, to who is there."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from driver_fakes import bind
from driver_fakes import data_file
from driver_fakes import data_lines
from driver_fakes import settings_of
from driver_fakes import wait_readable
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.devices.nmea.driver import NmeaGps
from rt_robot_os.sim.player import at_line_speed
from rt_robot_os.sim.player import by_nmea_time
from rt_robot_os.sim.player import load_log
from rt_robot_os.sim.player import Player
from rt_robot_os.sim.pty_port import PtyPort

S = 1_000_000_000
MS = 1_000_000


class Reader:
    """Somebody who reads a port to its end."""

    def __init__(self, port: PtyPort) -> None:
        self.port = port
        self.descriptor = os.open(port.link, os.O_RDWR | os.O_NOCTTY)
        self.data = b''

    def read(self) -> None:
        while len(self.data) < self.port.bytes_sent:
            self.data += os.read(self.descriptor, 4096)

    def close(self) -> None:
        os.close(self.descriptor)


@pytest.fixture
def port(tmp_path: Path) -> Any:
    port = PtyPort(tmp_path / 'log')
    port.plug()
    yield port
    port.unplug()


def play(player: Player, reader: Reader, until_ns: int = 10**13) -> list[tuple[int, int]]:
    """Call the player when it asks for it; gives time and number of bytes sent by then."""
    now_ns = 0
    found = []
    while not player.done and now_ns <= until_ns:
        player.pump(now_ns)
        reader.read()
        found.append((now_ns, player.port.bytes_sent))
        now_ns = max(player.next_event_ns(), now_ns + 1)
    return found


@pytest.mark.parametrize('name', [
    'haicom-305N', 'quectel', 'telit-he910', 'ublox-neo-m9n-nmea'])
def test_a_recording_comes_out_byte_by_byte_without_its_notes(name: str, port: PtyPort) -> None:
    lines = load_log(data_file(f'gps/{name}.log'))
    assert list(lines) == data_lines(f'gps/{name}.log')
    reader = Reader(port)
    player = Player(at_line_speed(lines), port, 115200)
    play(player, reader)
    assert reader.data == b''.join(lines)
    assert player.rounds == 1
    reader.close()


def test_bytes_come_at_the_speed_of_the_line(port: PtyPort) -> None:
    reader = Reader(port)
    player = Player(at_line_speed([bytes(960)]), port, 9600)
    found = play(player, reader)
    assert found[-1] == (pytest.approx(S, abs=MS), 960)
    assert all(sent <= now * 960 / S + 1 for now, sent in found)
    assert len(found) == pytest.approx(60, abs=2)
    reader.close()


def test_ten_times_faster(port: PtyPort) -> None:
    reader = Reader(port)
    found = play(Player(at_line_speed([bytes(960)]), port, 9600, speed=10.0), reader)
    assert found[-1] == (pytest.approx(S // 10, abs=MS), 960)
    reader.close()


def test_epochs_come_at_their_times(port: PtyPort) -> None:
    lines = load_log(data_file('gps/ublox-neo-m9n-nmea.log'))
    reader = Reader(port)
    found = play(Player(by_nmea_time(lines), port, 0), reader)
    # 61 epochs, one a second, each begins with its RMC.
    assert [now for now, _ in found] == [i * S for i in range(61)]
    epochs = b''.join(lines).split(b'$GNRMC')[1:]
    assert found[-1][1] - found[-2][1] == len(epochs[-1]) + 6
    reader.close()


def test_a_time_that_goes_back_is_not_waited_for_but_midnight_is(port: PtyPort) -> None:
    lines = [b'$GPGGA,%s,x*00\r\n' % t for t in (
        b'235959.00', b'000001.50', b'000000.00', b'000003.00', b'', b'nan', b'0000xx')]
    assert [offset for offset, _ in by_nmea_time(lines)] == [
        0, 2.5 * S, 2.5 * S, 5.5 * S, 5.5 * S, 5.5 * S, 5.5 * S]


def test_the_times_may_stand_in_other_sentences() -> None:
    lines = [b'$GPGLL,1,N,2,E,120000,A*00\n', b'$GPVTG,1*00\n', b'$GNZDA,120001.00*00\n']
    assert [offset for offset, _ in by_nmea_time(lines)] == [0, 0, S]


def test_a_log_without_times_cannot_be_played_by_them() -> None:
    with pytest.raises(ConfigError, match='no NMEA sentence .* at the speed of the line instead'):
        by_nmea_time([b'$GPVTG,1*00\n', b'abc'])


def test_looping_begins_again_after_the_last_epoch(port: PtyPort) -> None:
    lines = [b'$GPGGA,12000%d,x*00\r\n' % i for i in range(3)]
    reader = Reader(port)
    player = Player(by_nmea_time(lines), port, 0, loop=True)
    found = play(player, reader, until_ns=8 * S)
    assert [now for now, _ in found] == [i * S for i in range(9)]
    assert reader.data == b''.join(lines) * 3
    assert player.rounds == 3
    reader.close()


def test_looping_at_line_speed_does_not_pause(port: PtyPort) -> None:
    reader = Reader(port)
    player = Player(at_line_speed([b'0123456789'] * 20), port, 9600, loop=True)
    play(player, reader, until_ns=S)
    assert reader.data == (b'0123456789' * 100)[:len(reader.data)]
    assert len(reader.data) == pytest.approx(960, abs=20)
    reader.close()


def test_nobody_there_drops_and_counts(port: PtyPort) -> None:
    player = Player(at_line_speed([bytes(960)]), port, 9600)
    player.pump(0)
    player.pump(S)
    assert player.done
    assert (port.bytes_sent, port.bytes_dropped) == (0, 960)


def test_waiting_for_a_reader(port: PtyPort) -> None:
    player = Player(at_line_speed([b'abc']), port, 0, wait_for_reader=True)
    for now in range(0, S, S // 10):
        player.pump(now)
        assert now < player.next_event_ns() <= now + S // 10
    assert not player.done
    reader = Reader(port)
    player.pump(S)
    assert not player.done
    player.pump(2 * S)
    reader.read()
    assert player.done
    assert reader.data == b'abc'
    reader.close()


def test_it_stays_until_the_reader_has_fetched_the_end_or_has_gone(port: PtyPort) -> None:
    reader = Reader(port)
    player = Player(at_line_speed([b'abc']), port, 0)
    player.pump(0)
    assert player.done
    assert not player.over
    player.pump(S)
    assert not player.over
    player.pump(S + 1)
    assert player.over
    player.pump(S // 2)
    assert not player.over
    reader.close()
    assert player.over


def test_the_driver_gets_every_fix_of_a_recording(port: PtyPort) -> None:
    lines = load_log(data_file('gps/quectel.log'))
    device = NmeaGps('gps', settings_of(NmeaGps, port=str(port.link), baud=115200))
    fixes, times = bind(device)
    device.open()
    player = Player(by_nmea_time(lines), port, 115200)
    now = 0
    while not player.done:
        player.pump(now)
        while device.statistics().bytes_read < port.bytes_sent:
            wait_readable(device)
            device.read(now)
        now = max(player.next_event_ns(), now + 1)
    assert len(fixes.samples) == 42
    assert len(times.samples) == 34
    # One a second but for the eight epochs without time, which come with the one before.
    assert fixes.stamps[-1] - fixes.stamps[0] == pytest.approx(41 * S, abs=S // 20)
    device.close()


@pytest.mark.parametrize('content, message', [
    (b'', 'nothing to play'), (b'# only\n# notes\n', 'nothing to play'),
    (None, 'cannot be read .* check the path')])
def test_a_log_that_cannot_be_played(content: bytes | None, message: str, tmp_path: Path) -> None:
    if content is not None:
        (tmp_path / 'x.log').write_bytes(content)
    with pytest.raises(ConfigError, match=message):
        load_log(tmp_path / 'x.log')


def test_only_leading_notes_are_left_out_of_a_log_that_is_not_text(tmp_path: Path) -> None:
    (tmp_path / 'x.log').write_bytes(b'# note\n# \xc3\xa9\n\x55\xff\n#\x00data')
    assert b''.join(load_log(tmp_path / 'x.log')) == b'\x55\xff\n#\x00data'


@pytest.mark.parametrize('noise', [b'\xff', b'\0', b'\xb5\x62\x01\x07'])
@pytest.mark.parametrize('place', [0, 30, 1000, -1])
def test_noise_on_the_line_makes_no_one_line_of_a_log(noise: bytes, place: int, tmp_path: Path
                                                      ) -> None:
    clean = [b'# recorded on the roof\r\n', *(
        b'$GPGGA,1200%02d.00,4717.11,N,00833.91,E,1,08,1.01,499.6,M,48.0,M,,*5B\r\n' % second
        for second in range(30)), b'# the end\r\n']
    data = b''.join(clean[1:-1])
    at = place % len(data)
    data = data[:at] + noise + data[at:]
    (tmp_path / 'x.log').write_bytes(clean[0] + data + clean[-1])
    lines = load_log(tmp_path / 'x.log')
    assert b''.join(lines) == data
    pieces = by_nmea_time(lines)
    assert pieces[-1][0] == 29 * S
    assert len({offset for offset, _ in pieces}) >= 29


def test_sentences_between_frames_of_another_protocol_have_their_times(tmp_path: Path) -> None:
    frame = bytes(range(0x80, 0xe0)) + b'\n#\0'
    data = b''.join(frame + b'$GNRMC,1200%02d.00,A,,,,,,,,,,A*7A\r\n' % n for n in range(5))
    (tmp_path / 'x.ubx').write_bytes(data)
    lines = load_log(tmp_path / 'x.ubx')
    assert b''.join(lines) == data
    assert sorted({offset for offset, _ in by_nmea_time(lines)}) == [n * S for n in range(5)]


@pytest.mark.parametrize('arguments, message', [
    ({'baud': 9600, 'speed': 0.0}, 'speed 0'),
    ({'baud': 9600, 'speed': float('nan')}, 'speed nan'),
    ({'baud': -1}, 'baud -1'), ({'baud': 0, 'loop': True}, 'baud 0: a log without times')])
def test_what_makes_no_sense_is_refused(arguments: Any, message: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=message):
        Player(at_line_speed([b'abc']), PtyPort(tmp_path / 'x'), **arguments)
