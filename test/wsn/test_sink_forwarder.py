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

"""A sink behind a serial forwarder, over TCP: greetings, packets, commands, and what is wrong."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import select
import time
from typing import Any

from far_ends import TcpFar
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.devices.nmea.driver import NmeaGps
from rt_robot_os.features.wsn.packets.commands import command_packet
from rt_robot_os.features.wsn.packets.commands import parse_command
from rt_robot_os.features.wsn.packets.forwarding import Forwarder
from rt_robot_os.features.wsn.packets.framing import frame
from rt_robot_os.features.wsn.packets.framing import FrameReader
from rt_robot_os.features.wsn.packets.framing import TINYOS_1
from rt_robot_os.features.wsn.sink.driver import Sink
from rt_robot_os.features.wsn.sink.line import ForwarderLine
from rt_robot_os.testing import RecordingPublisher
from rt_robot_os.testing import settings_of
from test_sink import data

S = 1_000_000_000


class SfFar(TcpFar):
    scheme = 'sf'


class Sinking:
    """A sink, its publishers, and the forwarder that it is connected to."""

    def __init__(self, folder: Path, **settings: Any) -> None:
        self.far = SfFar(folder)
        self.device = Sink('dut', settings_of(Sink, port=self.far.port, **settings))
        self.publishers = [RecordingPublisher(each) for each in self.device.publications()]
        self.device.bind(self.publishers)
        self.device.open()

    def read(self, samples: int = 0) -> None:
        """Read what comes next, and on until there were so many samples."""
        while True:
            assert select.select([self.device.fileno()], [], [], 10)[0]
            self.device.receive(S, True)
            self.device.write(S)
            self.device.read(S)
            if self.device.statistics().samples >= samples:
                return

    @property
    def more(self) -> dict[str, Any]:
        return self.device.statistics().more


@pytest.fixture
def sinking(tmp_path: Path) -> Iterator[Any]:
    made: list[Sinking] = []

    def make(**settings: Any) -> Sinking:
        made.append(Sinking(tmp_path, **settings))
        return made[-1]

    yield make
    for each in made:
        each.device.close()
        each.far.go()


@pytest.mark.parametrize('version, platform_id', [(0x20, b''), (0x21, b'\x02\0\0\0')])
def test_packets_come_in_both_versions_of_tinyos_1(
        sinking: Any, version: int, platform_id: bytes) -> None:
    made = sinking()
    made.far.write(bytes((ord('T'), version)) + platform_id)
    assert made.far.read(2) == b'T!'
    reading = data(5, 42)
    made.far.write(bytes((len(reading),)) + reading[:9])
    made.read()
    if platform_id:
        assert made.far.read(4) == platform_id
    made.far.write(reading[9:] + bytes((len(reading),)) + data(5, 43))
    made.read(2)
    assert [bytes(each.data) for each in made.publishers[2].samples] == [reading, data(5, 43)]
    assert made.more['forwarder'] == 'connected'
    assert made.more['forwarder_platform'] == (2 if platform_id else 0)


def test_packets_come_from_a_forwarder_of_tinyos_2(sinking: Any) -> None:
    made = sinking(stack='tinyos2')
    made.far.write(b'U ')
    assert made.far.read(2) == b'U '
    made.far.write(bytes.fromhex('1a00ffff000012009300000400000100000064005d0056004f0048'))
    made.read(1)
    assert len(made.publishers[2].samples) == 1


def test_a_command_waits_for_the_greeting_and_goes_out(sinking: Any) -> None:
    made = sinking()
    made.device._take_command('sleep 5')
    assert made.more['forwarder'] == 'greeting'
    made.far.write(b'T ')
    made.read()
    made.device.receive(S, True)
    packet = command_packet(parse_command('sleep 5'), 'tinyos1')
    assert made.far.read(3 + len(packet)) == b'T!' + bytes((len(packet),)) + packet
    assert made.device.input_counters()['forwarded_commands'] == 1


def test_it_works_with_the_forwarder_of_this_package(sinking: Any) -> None:
    made = sinking()
    forwarder = Forwarder('tinyos1', 'telos')
    client = forwarder.connect()
    assert client is not None
    deadline_s = time.monotonic() + 60

    def pump() -> None:
        assert time.monotonic() < deadline_s
        made.far.write(forwarder.take_output(client))
        made.device.receive(S, True)
        made.device.write(S)
        made.device.read(S)
        if select.select([made.far.socket], [], [], 0.01)[0]:
            assert not forwarder.feed_client(client, made.far.socket.recv(4096))

    made.device._take_command('rate 5 2000')
    while not forwarder.link.waiting:
        pump()
    written, = FrameReader().feed(forwarder.poll_mote(S))
    assert written.packet == command_packet(parse_command('rate 5 2000'), 'tinyos1')
    forwarder.feed_mote(frame(0x42, data(5, 42)))
    while not made.device.statistics().samples:
        pump()
    assert bytes(made.publishers[2].samples[0].data) == data(5, 42)


@pytest.mark.parametrize('greeting, said', [
    (b'U ', 'the other side uses tinyos2, not tinyos1'),
    (b'HT', 'the other side is not a serial forwarder')])
def test_who_is_no_forwarder_of_ours_is_told(sinking: Any, greeting: bytes, said: str) -> None:
    made = sinking()
    made.far.write(greeting)
    made.read()
    with pytest.raises(DeviceError, match=f'dut: {said}'):
        made.device.write(S)
    assert made.more['forwarder'] == 'refused'
    made.device.open()
    assert made.more['forwarder'] == 'greeting'


def test_one_that_does_not_greet_is_told_soon(sinking: Any) -> None:
    made = sinking()
    assert made.far.read(2) == b'T!'
    made.device.write(S)
    assert made.device.quiet_s() == 0.0
    assert 'no serial forwarder answers' in made.device.silence()


def test_a_forwarder_that_goes_is_a_fault(sinking: Any) -> None:
    made = sinking()
    made.far.write(b'T ')
    made.read()
    made.far.go()
    with pytest.raises(DeviceError, match='dut: sf://127.0.0.1.*connected again'):
        for _ in range(10):
            made.read()


def test_other_drivers_refuse_a_forwarder() -> None:
    with pytest.raises(ConfigError, match='must be a path or begin with one of'):
        NmeaGps('gps', settings_of(NmeaGps, port='sf://localhost:9001'))


def test_every_byte_of_a_forwarder_is_accounted_for_at_every_split() -> None:
    stream = b'T!\x02\0\0\0' + b''.join(
        bytes((len(each),)) + each for each in (data(5, 1), data(5, 2), b'x' * 255)) + b'\x09abc'
    for at in range(len(stream) + 1):
        line = ForwarderLine(TINYOS_1, 'telos')
        found = [*line.feed(stream[:at]), *line.feed(stream[at:])]
        assert [each.packet for each in found] == [data(5, 1), data(5, 2), b'x' * 255]
        assert line.pending_bytes == 4
        line.reset()
        assert (line.pending_bytes, line.rejected_bytes, line.frames) == (0, 4, 3)
