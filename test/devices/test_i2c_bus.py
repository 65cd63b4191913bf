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

"""The bus: what carries it, sharing, errors, packets, preemption, the time on the wire."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
import errno
import os
from pathlib import Path
import socket
import sys
import threading
import time
from typing import Any

from driver_fakes import bind
from driver_fakes import settings_of
from hypothesis import given
from hypothesis import strategies as st
from i2c_bench import answer_of
from i2c_bench import failing
from i2c_bench import ScriptedTransport
from i2c_bench import transact
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.devices.bmp280.driver import Bmp280
from rt_robot_os.devices.bmp280.simulated import SimulatedBmp280
from rt_robot_os.devices.i2c import packets as i2c_packets
from rt_robot_os.devices.i2c.bus import ANSWER_TIMEOUT_NS
from rt_robot_os.devices.i2c.bus import DirectConnection
from rt_robot_os.devices.i2c.bus import I2cBus
from rt_robot_os.devices.i2c.bus import I2cBuses
from rt_robot_os.devices.i2c.bus import Transfer
from rt_robot_os.devices.i2c.real_bus import open_transport
from rt_robot_os.devices.i2c.simulated_bus import EmulatedBus
from rt_robot_os.devices.i2c.simulated_bus import transfer_ns
from rt_robot_os.devices.i2c.simulated_port import I2cPort
from rt_robot_os.devices.i2c.socket_bus import SocketTransport
from rt_robot_os.devices.mpu6050.driver import Mpu6050
from rt_robot_os.devices.mpu6050.simulated import SimulatedMpu6050
from rt_robot_os.devices.ms5611.simulated import SimulatedMs5611
from rt_robot_os.sim.server import SimServer

smbus2 = pytest.importorskip('smbus2', reason='smbus2 is not installed')


# --- packets -------------------------------------------------------------------------------------

@given(address=st.integers(0, 127), data=st.binary(max_size=64), size=st.integers(0, 4092))
def test_requests_survive_the_socket(address: int, data: bytes, size: int) -> None:
    packet = i2c_packets.request(7, address, data, size)
    assert i2c_packets.parse_request(packet) == (7, address, data, size)


@given(number=st.integers(0, 0xFFFF), code=st.integers(0, 0xFFFF), data=st.binary(max_size=64))
def test_answers_survive_the_socket(number: int, code: int, data: bytes) -> None:
    packet = i2c_packets.answer(number, code, data)
    assert i2c_packets.parse_answer(packet) == (number, code, data)


@given(st.binary(max_size=12))
def test_what_is_no_packet_is_none_or_in_range(packet: bytes) -> None:
    found = i2c_packets.parse_request(packet)
    assert found is None or (found[1] < 128 and found[3] <= 4096)
    i2c_packets.parse_answer(packet)


# --- sharing -------------------------------------------------------------------------------------

def test_a_bus_is_opened_once_and_closed_by_the_last(tmp_path: Path) -> None:
    (tmp_path / 'link').symlink_to(tmp_path / 'bus')
    made: list[ScriptedTransport] = []

    def opener(path: str) -> ScriptedTransport:
        made.append(ScriptedTransport(lambda data, size: bytes(size)))
        return made[-1]

    buses = I2cBuses(opener)
    first, second = buses.acquire(str(tmp_path / 'bus')), buses.acquire(str(tmp_path / 'link'))
    assert len(made) == buses.open_count == 1
    assert (first.path, second.path) == (str(tmp_path / 'bus'), str(tmp_path / 'link'))
    buses.release(first)
    buses.release(first)  # once too often
    assert not made[0].closed
    buses.release(second)
    assert made[0].closed == 1 and buses.open_count == 0
    buses.acquire(str(tmp_path / 'bus'))
    assert len(made) == 2


def test_a_bus_that_went_away_is_not_shared_any_more() -> None:
    made: list[ScriptedTransport] = []

    def opener(path: str) -> ScriptedTransport:
        made.append(ScriptedTransport(failing(errno.ENODEV)))
        return made[-1]

    buses = I2cBuses(opener)
    old, other = buses.acquire('/dev/i2c-1'), buses.acquire('/dev/i2c-1')
    with pytest.raises(DeviceError, match='the bus is gone'):
        transact(old, 8, b'', 1)
    new = buses.acquire('/dev/i2c-1')
    assert len(made) == buses.open_count == 2
    buses.release(old)
    assert not made[0].closed
    buses.release(other)
    assert made[0].closed and not made[1].closed
    buses.acquire('/dev/i2c-1')
    assert len(made) == 2
    buses.release(new)
    assert not made[1].closed


def test_transfers_and_failures_are_counted() -> None:
    connection = DirectConnection(ScriptedTransport(lambda data, size: bytes(size)))
    bus = I2cBus('/dev/i2c-1', connection)
    assert transact(bus, 0x20, b'\1ab', 0) == b''
    assert transact(bus, 0x20, b'\1', 3) == bytes(3)
    connection.transport = ScriptedTransport(failing(errno.EIO))
    with pytest.raises(DeviceError, match='address 0x20: the transfer failed .EIO: Input/output'):
        transact(bus, 0x20, b'\1', 3)
    assert (bus.transfers, bus.failures, bus.gone) == (2, 1, False)


# --- what the path is ----------------------------------------------------------------------------

def test_a_path_that_is_no_bus(tmp_path: Path) -> None:
    (tmp_path / 'file').write_text('')
    for path in (str(tmp_path / 'file'), str(tmp_path), '/dev/null'):
        with pytest.raises(DeviceError, match='is not an I2C bus: check the port'):
            open_transport(path)
    with pytest.raises(DeviceError, match='does not exist: ls /dev/i2c-'):
        open_transport(str(tmp_path / 'none'))


def test_without_smbus2_a_real_bus_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, 'smbus2', None)
    monkeypatch.delitem(sys.modules, 'rt_robot_os.devices.i2c.linux_bus', raising=False)
    with pytest.raises(DeviceError, match='needs smbus2 .*(install i2c|smbus2)'):
        open_transport('/dev/null')


def test_a_bus_that_may_not_be_opened(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(self: Any, path: str) -> None:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    monkeypatch.setattr(smbus2.SMBus, 'open', refuse)
    with pytest.raises(DeviceError, match='group i2c .sudo usermod -aG i2c .USER.*log in again'):
        open_transport('/dev/null')


def test_a_failed_open_leaves_no_file_open() -> None:
    before = len(os.listdir('/proc/self/fd'))
    for _ in range(5):
        with pytest.raises(DeviceError):
            open_transport('/dev/null')
    assert len(os.listdir('/proc/self/fd')) == before


# --- smbus2 --------------------------------------------------------------------------------------

class KernelBus:
    """Stands for the kernel below smbus2: its calls, on an emulated bus."""

    def __init__(self, port: I2cPort, functions: int) -> None:
        self.bus = port.bus
        self.functions = functions
        self.opened = 0
        self.now_ns = 10**9

    def transfer(self, address: int, data: bytes, size: int) -> bytes:
        number, answer, _ = self.bus.transfer(address, data, size, self.now_ns)
        if number:
            raise OSError(number, os.strerror(number))
        return answer

    def smbus(kernel) -> type:  # noqa: N805
        """Make the class that takes the place of ``smbus2.SMBus``."""
        class Bus(smbus2.SMBus):  # type: ignore[misc]
            def open(self, path: str) -> None:  # noqa: A003
                kernel.opened += 1
                self.fd = os.open('/dev/null', os.O_RDWR)
                self.funcs = smbus2.I2cFunc(kernel.functions)

            def i2c_rdwr(self, *messages: Any) -> None:
                assert len({m.addr for m in messages}) == 1
                written = b''.join(bytes(m) for m in messages if not m.flags & 1)
                reads = [m for m in messages if m.flags & 1]
                answer = kernel.transfer(messages[0].addr, written, sum(map(len, reads)))
                for m in reads:
                    for i in range(len(m)):
                        m.buf[i] = answer[i]

            def read_i2c_block_data(self, address: int, register: int, size: int,
                                    force: Any = None) -> list[int]:
                assert size <= 32
                return list(kernel.transfer(address, bytes((register,)), size))

            def write_i2c_block_data(self, address: int, register: int, data: Any,
                                     force: Any = None) -> None:
                kernel.transfer(address, bytes((register, *data)), 0)

            def write_byte_data(self, address: int, register: int, value: int,
                                force: Any = None) -> None:
                kernel.transfer(address, bytes((register, value)), 0)

            def write_byte(self, address: int, value: int, force: Any = None) -> None:
                kernel.transfer(address, bytes((value,)), 0)

        return Bus


@pytest.mark.parametrize('functions', [smbus2.I2cFunc.I2C, smbus2.I2cFunc.SMBUS_I2C_BLOCK],
                         ids=['i2c', 'smbus'])
def test_drivers_run_over_smbus2_on_both_kinds_of_adapters(
        functions: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from rt_robot_os.devices.i2c.linux_bus import LinuxTransport
    port = I2cPort(tmp_path / 'bus')
    SimulatedBmp280('b', {}, port)
    SimulatedMs5611('m', {}, port)
    kernel = KernelBus(port, functions)
    monkeypatch.setattr(smbus2, 'SMBus', kernel.smbus())
    buses = I2cBuses(LinuxTransport)
    from rt_robot_os.devices.ms5611.driver import Ms5611
    devices: list[Any] = [cls('dut', settings_of(cls, port='/dev/i2c-1'))
                          for cls in (Bmp280, Ms5611)]
    samples = [0, 0]
    for device in devices:
        device.buses = buses
        device.clock_ns = lambda: kernel.now_ns
        bind(device)
        device.open()
    # Where the address is a property of the file, each has one of its own.
    assert kernel.opened == (1 if functions == smbus2.I2cFunc.I2C else 3)
    for _ in range(1000):
        kernel.now_ns += 1_000_000
        for i, device in enumerate(devices):
            samples[i] += device.read(kernel.now_ns)
    for device in devices:
        device.close()
    assert samples[0] == pytest.approx(75, abs=5) and samples[1] == pytest.approx(60, abs=5)


def test_the_time_out_of_the_adapter_is_set(
        monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from rt_robot_os.devices.i2c import linux_bus as i2c_linux
    calls: list[tuple[int, int]] = []
    monkeypatch.setattr(i2c_linux.fcntl, 'ioctl', lambda fd, what, value: calls.append(
        (what, value)))
    kernel = KernelBus(I2cPort(tmp_path / 'bus'), smbus2.I2cFunc.I2C)
    monkeypatch.setattr(smbus2, 'SMBus', kernel.smbus())
    i2c_linux.LinuxTransport('/dev/i2c-1').close()
    assert calls == [(0x0702, 5)]  # 50 ms, in the unit of linux/i2c-dev.h


def test_what_smbus_cannot_do_is_an_error(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from rt_robot_os.devices.i2c.linux_bus import LinuxTransport
    kernel = KernelBus(I2cPort(tmp_path / 'bus'), smbus2.I2cFunc.SMBUS_I2C_BLOCK)
    monkeypatch.setattr(smbus2, 'SMBus', kernel.smbus())
    below = LinuxTransport('/dev/i2c-1')
    bus = I2cBus('/dev/i2c-1', DirectConnection(below))
    for data, size in ((b'\0', 33), (bytes(40), 0), (b'', 1)):
        with pytest.raises(DeviceError, match='the adapter does not support this transfer'):
            transact(bus, 0x76, data, size)
    below.close()


def test_a_chip_that_linux_has_is_not_talked_to(
        monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from rt_robot_os.devices.i2c import linux_bus as i2c_linux
    chip = tmp_path / '1-0076'
    chip.mkdir()
    (tmp_path / 'bmp280').mkdir()
    (chip / 'driver').symlink_to(tmp_path / 'bmp280')
    monkeypatch.setattr(i2c_linux, '_SYSFS', str(tmp_path))
    kernel = KernelBus(I2cPort(tmp_path / 'bus'), smbus2.I2cFunc.I2C)
    monkeypatch.setattr(smbus2, 'SMBus', kernel.smbus())
    below = i2c_linux.LinuxTransport('/dev/i2c-1')
    bus = I2cBus('/dev/i2c-1', DirectConnection(below))
    with pytest.raises(DeviceError, match='busy .the Linux driver bmp280 has the device.*0076'):
        transact(bus, 0x76, b'\xd0', 1)
    with pytest.raises(DeviceError, match='no device answers'):
        transact(bus, 0x77, b'\xd0', 1)
    below.close()


# --- the socket ----------------------------------------------------------------------------------

@pytest.fixture
def served(tmp_path: Path) -> Iterator[I2cPort]:
    """Serve two chips from another thread, as another process would."""
    port = I2cPort(tmp_path / 'i2c-sim')
    chips = (SimulatedBmp280('baro', {}, port), SimulatedMpu6050('imu', {}, port))
    port.plug()
    server = SimServer(chips)
    thread = threading.Thread(target=server.run)
    thread.start()
    yield port
    server.stop()
    thread.join(60)
    assert sorted(os.listdir(tmp_path)) == []


def test_both_paths_lead_to_one_bus(served: I2cPort) -> None:
    buses = I2cBuses()
    one = buses.acquire(str(served.socket_path.with_name('baro')))
    two = buses.acquire(str(served.socket_path.with_name('imu')))
    assert buses.open_count == 1
    assert transact(one, 0x76, b'\xd0', 1) == b'\x58'
    assert transact(two, 0x68, b'\x75', 1) == b'\x68'
    with pytest.raises(DeviceError, match='address 0x33: no device answers'):
        transact(one, 0x33, b'\0', 1)
    buses.release(one)
    buses.release(two)


def test_a_transaction_within_another_gets_its_own_answer(served: I2cPort) -> None:
    buses = I2cBuses()
    baro, imu = (buses.acquire(str(served.socket_path)) for _ in range(2))
    for _ in range(20):
        baro.begin(Transfer(0x76, b'\xd0', 1), time.monotonic_ns())
        assert transact(imu, 0x68, b'\x75', 1) == b'\x68'
        assert answer_of(baro) == b'\x58'
    buses.release(baro)
    buses.release(imu)


def test_a_transfer_takes_the_time_that_it_takes_on_the_wire(served: I2cPort) -> None:
    transport = SocketTransport(str(served.socket_path))
    transport.transfer(0x76, b'\xd0', 1)
    begin_ns = time.monotonic_ns()
    for _ in range(5):
        transport.transfer(0x76, b'\xf3', 10)
    assert time.monotonic_ns() - begin_ns >= 5 * transfer_ns(1, 10)
    transport.close()


def test_an_answer_that_comes_too_late_is_not_taken_for_the_next(served: I2cPort) -> None:
    # Also of a job that the kernel aborted: nobody took the answer to what it had begun.
    buses = I2cBuses()
    bus = buses.acquire(str(served.socket_path))
    now_ns = time.monotonic_ns()
    bus.begin(Transfer(0x76, b'\x88', 200), now_ns)
    with pytest.raises(DeviceError, match='no answer for 0.3 s from the process that serves'):
        bus.answer(now_ns + ANSWER_TIMEOUT_NS + 1)
    for _ in range(5):
        bus.begin(Transfer(0x76, b'\x88', 100), now_ns)
        assert transact(bus, 0x76, b'\xd0', 1) == b'\x58'
    buses.release(bus)


@pytest.mark.parametrize('packet', [b'x', b'\x09\x76\x01\x00', bytes(5000)])
def test_a_client_that_talks_nonsense_is_dropped_and_others_are_served(
        served: I2cPort, packet: bytes) -> None:
    good = SocketTransport(str(served.socket_path))
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as bad:
        bad.connect(str(served.socket_path))
        bad.send(packet)
        assert bad.recv(10) == b''
    assert good.transfer(0x76, b'\xd0', 1) == b'\x58'
    good.close()


def test_nobody_behind_the_socket(tmp_path: Path) -> None:
    port = I2cPort(tmp_path / 'i2c-sim')
    path = port.link('baro')
    port.plug()
    buses = I2cBuses()
    bus = buses.acquire(str(path))
    port.unplug()
    port.unplug()
    with pytest.raises(DeviceError, match='the bus is gone'):
        transact(bus, 0x76, b'\0', 1)
    assert bus.gone
    buses.release(bus)
    for opened in (open_transport, buses.acquire):
        with pytest.raises(DeviceError, match='does not exist'):
            opened(str(path))
    assert os.listdir(tmp_path) == []


def test_a_file_of_somebody_is_not_replaced(tmp_path: Path) -> None:
    port = I2cPort(tmp_path / 'i2c-sim')
    port.link('baro').write_text('mine')
    with pytest.raises(DeviceError, match='file of another program.*choose another folder'):
        port.plug()
    port.unplug()
    assert (tmp_path / 'baro').read_text() == 'mine'


# --- the emulated bus ----------------------------------------------------------------------------

def test_the_time_on_the_wire() -> None:
    # Start, address, register, repeated start, address, 14 bytes, stop: 9 bits each.
    assert transfer_ns(1, 14, 400_000) == (3 + 9 * 17) * 2500
    assert transfer_ns(3, 0, 100_000) == (2 + 9 * 4) * 10_000
    assert transfer_ns(0, 1, 100_000) == (2 + 1 + 9 * 2) * 10_000
    assert transfer_ns(0, 0, 100_000) == (2 + 9) * 10_000


def test_two_chips_of_one_address_are_refused(tmp_path: Path) -> None:
    port = I2cPort(tmp_path / 'bus')
    SimulatedBmp280('one', {}, port)
    with pytest.raises(ConfigError, match='two: address 0x76 is that of one: give each chip its'):
        SimulatedMs5611('two', {}, port, 0x76)


def test_nobody_answers_on_an_empty_bus() -> None:
    number, answer, _ = EmulatedBus().transfer(0x50, b'\0', 1, 0)
    assert (number, answer) == (errno.EREMOTEIO, b'')


def test_one_chip_that_holds_the_bus_stops_all(tmp_path: Path) -> None:
    port = I2cPort(tmp_path / 'bus')
    baro = SimulatedBmp280('baro', {'faults': ['hold at 1 for 1']}, port)
    SimulatedMpu6050('imu', {}, port).start(0)
    baro.start(0)
    wanted: Callable[[int], int] = lambda now: port.bus.transfer(0x68, b'\x75', 1, now)[0]  # noqa
    assert [wanted(t * 10**8) for t in (9, 10, 19, 20)] == [
        0, errno.ETIMEDOUT, errno.ETIMEDOUT, 0]


def test_the_drivers_are_on_a_bus_and_the_others_are_not() -> None:
    from rt_robot_os.devices.witmotion.driver import WitMotion
    assert Bmp280.SHARES_PORT and Mpu6050.SHARES_PORT and not WitMotion.SHARES_PORT
