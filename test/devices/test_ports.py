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

"""Every port, whatever carries it: bytes both ways, never waiting, errors with a remedy."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
import select
import socket
from typing import Any
from typing import ClassVar

from driver_fakes import bind
from driver_fakes import settings_of
from far_ends import Far
from far_ends import ListenFar
from far_ends import needs_v6
from far_ends import PtyFar
from far_ends import Tcp6Far
from far_ends import TcpFar
from far_ends import UdpFar
import pytest
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.reports import Reports
from rt_robot_os.devices.manager import SensorManager
from rt_robot_os.devices.nmea.driver import NmeaGps
from rt_robot_os.devices.nmea.wire import sentence
from rt_robot_os.devices.serial.port import open_port
from rt_robot_os.devices.state import DeviceState
from rt_robot_os.devices.state import RecoverySettings
from rt_robot_os.kernel import Kernel
from rt_robot_os.topics import Bus
from took_little import took_little

S = 1_000_000_000


class PortContract:
    """
    What every port has to do.

    :cvar far: the other end.
    :cvar hello: what the driver has to send first, if anything.
    """

    far: ClassVar[type[Far]]
    hello: ClassVar[bytes] = b''

    @contextmanager
    def pair(self, folder: Path) -> Iterator[tuple[Any, Any]]:
        far = self.far(folder)
        port = open_port(far.port, None)
        port.write(self.hello)
        try:
            yield port, far
        finally:
            port.close()
            far.go()

    def read(self, port: Any, count: int) -> bytes:
        found = b''
        while len(found) < count:
            assert select.select([port.fileno()], [], [], 10)[0], found
            data = port.read()
            assert len(data) <= 2 * 65536
            found += data
        return found

    def test_bytes_go_both_ways(self, tmp_path: Path) -> None:
        with self.pair(tmp_path) as (port, far):
            every_byte = bytes(range(256))
            far.write(every_byte)
            assert self.read(port, 256) == every_byte
            assert port.bytes_read == 256
            far.read(len(self.hello)) if self.hello and isinstance(far, TcpFar) else None
            port.write(every_byte)
            assert far.read(256) == every_byte
            assert port.dropped_write_bytes == 0

    def test_reading_nothing_is_no_error_and_does_not_wait(self, tmp_path: Path) -> None:
        with self.pair(tmp_path) as (port, _):
            assert [port.read() for _ in range(3)] == [b''] * 3
            assert port.bytes_read == 0

    def test_much_comes_in_order(self, tmp_path: Path) -> None:
        with self.pair(tmp_path) as (port, far):
            for _ in range(20):
                data = bytes(range(250)) * 12
                far.write(data)
                assert self.read(port, len(data)) == data

    def test_closing_may_be_repeated(self, tmp_path: Path) -> None:
        with self.pair(tmp_path) as (port, _):
            port.close()
            port.close()
            assert port.fileno() == -1

    def test_a_device_of_it_gives_samples_and_is_opened_again(self, tmp_path: Path) -> None:
        far = self.far(tmp_path)
        device = NmeaGps('dut', settings_of(NmeaGps, port=far.port, baud=0))
        publishers = bind(device)
        fix = sentence('GNGGA,123519.00,4807.0380,N,01131.0000,E,1,08,0.9,545.4,M,46.9,M,,')
        for turn in range(2):
            device.open()
            device.send(b'hello')
            far.write(fix * 3)
            while device.statistics().frames < 3 * (turn + 1):
                assert select.select([device.fileno()], [], [], 10)[0]
                device.read(S)
            device.close()
            if isinstance(far, TcpFar):
                far.socket.close()
                far._socket = None
            elif isinstance(far, UdpFar) and not isinstance(far, ListenFar):
                far._driver = None
        assert publishers[0].samples
        assert device.statistics().rejected_bytes == 0
        far.go()


class StreamContract(PortContract):
    """What those have to do that are streams."""

    def test_what_came_before_the_end_is_not_lost_and_then_it_is_an_error(
            self, tmp_path: Path) -> None:
        with self.pair(tmp_path) as (port, far):
            far.write(b'last words')
            assert self.read(port, 10) == b'last words'
            far.go()
            with pytest.raises(DeviceError, match='again'):
                while select.select([port.fileno()], [], [], 10)[0]:
                    port.read()

    def test_what_is_not_taken_waits_and_then_is_dropped_whole(self, tmp_path: Path) -> None:
        with self.pair(tmp_path) as (port, _):
            for _ in range(100_000):
                port.write(b'command;' * 64)
                if port.dropped_write_bytes > 1024:
                    break
            assert port.dropped_write_bytes > 0 and port.dropped_write_bytes % 512 == 0


class TestPty(StreamContract):
    far = PtyFar


class TestTcp(StreamContract):
    far = TcpFar


@needs_v6
class TestTcp6(StreamContract):
    far = Tcp6Far


class TestUdp(PortContract):
    far = UdpFar
    hello = b'hello'

    def test_bytes_go_both_ways(self, tmp_path: Path) -> None:
        with self.pair(tmp_path) as (port, far):
            far.write(b'\x00\xff')
            assert self.read(port, 2) == b'\x00\xff'
            port.write(b'')
            port.write(b'whole')
            assert far.read(5) == b'whole'


class TestUdpListen(PortContract):
    far = ListenFar


# --- TCP -----------------------------------------------------------------------------------------

def test_a_refused_connection_says_so() -> None:
    with socket.create_server(('127.0.0.1', 0)) as listener:
        number = listener.getsockname()[1]
    port = open_port(f'tcp://127.0.0.1:{number}', None)
    with pytest.raises(DeviceError, match=f'tcp://127.0.0.1:{number}: the connection was refused'):
        while select.select([port.fileno()], [], [], 10)[0]:
            port.read()
    port.close()


@pytest.fixture
def full() -> Iterator[str]:
    """Give the port of a host that does not answer: the queue of its listener is full."""
    listener = socket.socket()
    listener.bind(('127.0.0.1', 0))
    listener.listen(0)
    waiting = []
    for _ in range(4):
        waiting.append(socket.socket())
        waiting[-1].setblocking(False)
        waiting[-1].connect_ex(listener.getsockname())
    yield f'tcp://127.0.0.1:{listener.getsockname()[1]}'
    for each in (*waiting, listener):
        each.close()


def test_a_host_that_does_not_answer_costs_no_time_and_is_named(full: str) -> None:
    device = NmeaGps('gps', settings_of(NmeaGps, port=full, baud=0))
    kernel = Kernel()
    reports = Reports()
    manager = SensorManager(kernel, Bus(kernel), reports)
    managed = manager.add(device, rate_hz=100.0, priority=40, interrupt=True,
                          recovery=RecoverySettings(S // 5, S // 20, S // 10))

    def look() -> None:
        if managed.faults >= 2:
            kernel.stop('seen')

    kernel.add_task('low', look, priority=2, rate_hz=100.0)
    assert kernel.run(60 * S) == 'seen'
    assert managed.task is not None and took_little(kernel, managed.task)
    manager.close()
    assert f'{full} does not answer to the connection: check address and cable' in managed.reason


def test_a_server_that_ends_and_comes_back_is_connected_again(tmp_path: Path) -> None:
    far = TcpFar(tmp_path)
    fix = sentence('GNGGA,123519.00,4807.0380,N,01131.0000,E,1,08,0.9,545.4,M,46.9,M,,')
    device = NmeaGps('gps', settings_of(NmeaGps, port=far.port, baud=0))
    kernel = Kernel()
    manager = SensorManager(kernel, Bus(kernel), Reports())
    managed = manager.add(device, rate_hz=100.0, priority=40, interrupt=True,
                          recovery=RecoverySettings(S, S // 20, S // 10))
    clients: list[socket.socket] = []
    far.listener.setblocking(False)
    ended = 0

    def serve() -> None:
        nonlocal ended
        try:
            clients.append(far.listener.accept()[0])
        except BlockingIOError:
            pass
        for client in clients[-1:]:
            if managed.state is DeviceState.ACTIVE and len(clients) == 1 and not ended:
                ended = managed.opened
                client.close()
            elif client.fileno() >= 0:
                client.send(fix)
        if ended and len(clients) > 1 and managed.state is DeviceState.ACTIVE:
            kernel.stop('again')

    kernel.add_task('server', serve, priority=10, rate_hz=20.0)
    assert kernel.run(60 * S) == 'again', managed.reason
    manager.close()
    assert managed.faults == 1 and managed.opened == 2
    for client in clients:
        client.close()
    far.go()


def test_gpsd_is_asked_for_the_bytes_of_its_receiver(tmp_path: Path) -> None:
    far = TcpFar(tmp_path)
    port = open_port(far.port.replace('tcp:', 'gpsd:'), None)
    assert far.read(32) == b'?WATCH={"enable":true,"raw":2};\n'
    port.close()
    far.go()


# --- UDP -----------------------------------------------------------------------------------------

def test_others_than_the_one_heard_first_are_not_mixed_in(tmp_path: Path) -> None:
    far = ListenFar(tmp_path)
    port: Any = open_port(far.port.replace('://:', '://0.0.0.0:'), None)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(('127.0.0.2', 0))
        far.write(b'first')
        other.sendto(b'other', far._driver)
        far.write(b'second')
        found = b''
        while found != b'firstsecond':
            assert select.select([port.fileno()], [], [], 10)[0], found
            found += port.read()
    assert port.more() == {'foreign_datagrams': 1}
    port.close()
    far.go()


def test_what_was_not_used_is_seen_in_the_counters_of_the_device(tmp_path: Path) -> None:
    far = ListenFar(tmp_path)
    device = NmeaGps('gps', settings_of(NmeaGps, port=far.port, baud=0))
    bind(device)
    assert device.statistics().more == {}
    device.open()
    assert device.statistics().more == {'foreign_datagrams': 0}
    device.close()
    far.go()


def test_what_nobody_listens_to_is_an_error() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(('127.0.0.1', 0))
        number = free.getsockname()[1]
    port = open_port(f'udp://127.0.0.1:{number}', None)
    with pytest.raises(DeviceError, match='no program listens there'):
        port.write(b'x')
        while select.select([port.fileno()], [], [], 10)[0]:
            port.read()
    port.close()


def test_a_port_that_another_listens_on_is_an_error() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(('0.0.0.0', 0))
        with pytest.raises(DeviceError, match='another program listens there'):
            open_port(f'udp-listen://:{other.getsockname()[1]}', None)
    with pytest.raises(DeviceError, match='does not have that address'):
        open_port('udp-listen://192.0.2.7:5000', None)


def test_frames_of_a_network_are_not_dated_back(tmp_path: Path) -> None:
    far = TcpFar(tmp_path)
    device = NmeaGps('gps', settings_of(NmeaGps, port=far.port, baud=9600))
    publishers = bind(device)
    device.open()
    far.write(sentence('GNGGA,123519.00,4807.0380,N,01131.0000,E,1,08,0.9,545.4,M,46.9,M,,')
              + sentence('GNRMC,123519.00,A,4807.038,N,01131.000,E,0.0,0.0,230394,,,A'))
    while device.statistics().frames < 2:
        assert select.select([device.fileno()], [], [], 10)[0]
        device.read(77 * S)
    assert set(publishers[0].stamps) == {77 * S}
    device.close()
    far.go()
