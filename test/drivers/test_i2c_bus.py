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
import re
import signal
import socket
import subprocess
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
from i2c_bench import i2c_rig
from i2c_bench import ScriptedTransport
from i2c_bench import transact
from i2c_bench import wait_until
import pytest
from rt_robot_os.cli.i2c_bridge import open_transport
from rt_robot_os.drivers.bmp280 import Bmp280
from rt_robot_os.drivers.encoders import i2c_packets
from rt_robot_os.drivers.i2c import ANSWER_TIMEOUT_NS
from rt_robot_os.drivers.i2c import DirectConnection
from rt_robot_os.drivers.i2c import I2cBus
from rt_robot_os.drivers.i2c import I2cBuses
from rt_robot_os.drivers.i2c import Transfer
from rt_robot_os.drivers.i2c_socket import SocketConnection
from rt_robot_os.drivers.i2c_socket import SocketTransport
from rt_robot_os.drivers.mpu6050 import Mpu6050
from rt_robot_os.errors import ConfigError
from rt_robot_os.errors import DeviceError
from rt_robot_os.kernel import Kernel
from rt_robot_os.reports import Reports
from rt_robot_os.sensors import SensorManager
from rt_robot_os.sim.bmp280 import SimulatedBmp280
from rt_robot_os.sim.i2c_bus import EmulatedBus
from rt_robot_os.sim.i2c_bus import transfer_ns
from rt_robot_os.sim.i2c_port import I2cPort
from rt_robot_os.sim.mpu6050 import SimulatedMpu6050
from rt_robot_os.sim.ms5611 import SimulatedMs5611
from rt_robot_os.sim.server import SimServer
from rt_robot_os.topics import Bus

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
    first, second = buses.take(str(tmp_path / 'bus')), buses.take(str(tmp_path / 'link'))
    assert len(made) == buses.open_count == 1
    assert (first.path, second.path) == (str(tmp_path / 'bus'), str(tmp_path / 'link'))
    buses.give_back(first)
    buses.give_back(first)  # once too often
    assert not made[0].closed
    buses.give_back(second)
    assert made[0].closed == 1 and buses.open_count == 0
    buses.take(str(tmp_path / 'bus'))
    assert len(made) == 2


def test_a_bus_that_went_away_is_not_shared_any_more() -> None:
    made: list[ScriptedTransport] = []

    def opener(path: str) -> ScriptedTransport:
        made.append(ScriptedTransport(failing(errno.ENODEV)))
        return made[-1]

    buses = I2cBuses(opener)
    old, other = buses.take('/dev/i2c-1'), buses.take('/dev/i2c-1')
    with pytest.raises(DeviceError, match='the bus is gone'):
        transact(old, 8, b'', 1)
    new = buses.take('/dev/i2c-1')
    assert len(made) == buses.open_count == 2
    buses.give_back(old)
    assert not made[0].closed
    buses.give_back(other)
    assert made[0].closed and not made[1].closed
    buses.take('/dev/i2c-1')
    assert len(made) == 2
    buses.give_back(new)
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
    monkeypatch.delitem(sys.modules, 'rt_robot_os.drivers.i2c_linux', raising=False)
    with pytest.raises(DeviceError, match='apt install python3-smbus2, or pip install smbus2'):
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
    from rt_robot_os.drivers.i2c_linux import LinuxTransport
    port = I2cPort(tmp_path / 'bus')
    SimulatedBmp280('b', {}, port)
    SimulatedMs5611('m', {}, port)
    kernel = KernelBus(port, functions)
    monkeypatch.setattr(smbus2, 'SMBus', kernel.smbus())
    buses = I2cBuses(LinuxTransport)
    from rt_robot_os.drivers.ms5611 import Ms5611
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
    from rt_robot_os.drivers import i2c_linux
    calls: list[tuple[int, int]] = []
    monkeypatch.setattr(i2c_linux.fcntl, 'ioctl', lambda fd, what, value: calls.append(
        (what, value)))
    kernel = KernelBus(I2cPort(tmp_path / 'bus'), smbus2.I2cFunc.I2C)
    monkeypatch.setattr(smbus2, 'SMBus', kernel.smbus())
    i2c_linux.LinuxTransport('/dev/i2c-1').close()
    assert calls == [(0x0702, 5)]  # 50 ms, in the unit of linux/i2c-dev.h


def test_what_smbus_cannot_do_is_an_error(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from rt_robot_os.drivers.i2c_linux import LinuxTransport
    kernel = KernelBus(I2cPort(tmp_path / 'bus'), smbus2.I2cFunc.SMBUS_I2C_BLOCK)
    monkeypatch.setattr(smbus2, 'SMBus', kernel.smbus())
    below = LinuxTransport('/dev/i2c-1')
    bus = I2cBus('/dev/i2c-1', DirectConnection(below))
    for data, size in ((b'\0', 33), (bytes(40), 0), (b'', 1)):
        with pytest.raises(DeviceError, match='the adapter cannot do this transfer'):
            transact(bus, 0x76, data, size)
    below.close()


def test_a_chip_that_linux_has_is_not_talked_to(
        monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from rt_robot_os.drivers import i2c_linux
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
    thread.join(10)
    assert sorted(os.listdir(tmp_path)) == []


def test_both_paths_lead_to_one_bus(served: I2cPort) -> None:
    buses = I2cBuses()
    one = buses.take(str(served.socket_path.with_name('baro')))
    two = buses.take(str(served.socket_path.with_name('imu')))
    assert buses.open_count == 1
    assert transact(one, 0x76, b'\xd0', 1) == b'\x58'
    assert transact(two, 0x68, b'\x75', 1) == b'\x68'
    with pytest.raises(DeviceError, match='address 0x33: no device answers'):
        transact(one, 0x33, b'\0', 1)
    buses.give_back(one)
    buses.give_back(two)


def test_a_transaction_within_another_gets_its_own_answer(served: I2cPort) -> None:
    buses = I2cBuses()
    baro, imu = (buses.take(str(served.socket_path)) for _ in range(2))
    for _ in range(20):
        baro.begin(Transfer(0x76, b'\xd0', 1), time.monotonic_ns())
        assert transact(imu, 0x68, b'\x75', 1) == b'\x68'
        assert answer_of(baro) == b'\x58'
    buses.give_back(baro)
    buses.give_back(imu)


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
    bus = buses.take(str(served.socket_path))
    now_ns = time.monotonic_ns()
    bus.begin(Transfer(0x76, b'\x88', 200), now_ns)
    with pytest.raises(DeviceError, match='no answer for 0.3 s from the process that serves'):
        bus.answer(now_ns + ANSWER_TIMEOUT_NS + 1)
    for _ in range(5):
        bus.begin(Transfer(0x76, b'\x88', 100), now_ns)
        assert transact(bus, 0x76, b'\xd0', 1) == b'\x58'
    buses.give_back(bus)


# --- the bus of a process that stands still ------------------------------------------------------

def test_nothing_waits_for_a_bus_that_nobody_serves(tmp_path: Path) -> None:
    port = I2cPort(tmp_path / 'bus')
    port.plug()
    buses = I2cBuses()
    now_ns = 10**9
    devices: list[Any] = [cls('dut', settings_of(cls, port=str(port.socket_path)))
                          for cls in (Bmp280, Mpu6050)]
    said = []
    for device in devices:
        device.buses = buses
        device.clock_ns = lambda: now_ns
        bind(device)
        device.open()  # the connection waits in the queue of the listener
        assert device.fileno() > 0
    for _ in range(50):
        now_ns += 10**7
        for device in devices:
            try:
                assert device.read(now_ns) == 0
            except DeviceError as error:
                said.append(str(error))
                device.open()
    assert len(said) == 2
    assert all(re.match('dut: I2C bus .*, address 0x..: no answer for 0.3 s', each)
               for each in said)
    for device in devices:
        device.close()
    port.unplug()


def test_what_was_given_up_is_not_done_later(tmp_path: Path) -> None:
    port = I2cPort(tmp_path / 'bus')
    done: list[bytes] = []

    class Carrier:
        def transfer(self, address: int, data: bytes, size: int,
                     now_ns: int) -> tuple[int, bytes, int]:
            done.append(data)
            return 0, bytes(size), 0

    port = I2cPort(tmp_path / 'bus', Carrier())
    port.plug()
    first, second = (SocketConnection(str(port.socket_path)) for _ in range(2))
    first.begin(0x76, b'reset', 0)
    first.close()
    second.begin(0x76, b'\xd0', 1)
    for now_ns in range(10):
        port.serve(now_ns)
    assert done == [b'\xd0'] and second.answer() == b'\0'
    second.close()
    port.unplug()


def test_too_many_that_wait_for_a_process_is_an_error_not_a_wait(tmp_path: Path) -> None:
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    listener.bind(str(tmp_path / 'bus'))
    listener.listen(1)
    buses, taken = I2cBuses(), []
    with pytest.raises(DeviceError, match='too many wait for the process that serves it'):
        for _ in range(20):
            taken.append(buses.take(str(tmp_path / 'bus')))
    for bus in taken:
        buses.give_back(bus)
    assert buses.open_count == 0
    listener.close()


# --- mistakes of a driver ------------------------------------------------------------------------

class Forgetful(Bmp280):
    """Calls what should be yielded, in three ways."""

    how = 0

    def begin(self, now_ns: int) -> Any:
        if self.how == 0:
            self.put(0xE0, 0xB6)
            return self.then(self.begin, now_ns)
        return self._begin()

    def _begin(self) -> Any:
        if self.how == 1:
            self.put(0xE0, 0xB6)
        yield self.fetch(0xD0, 1)
        if self.how == 2:
            self.put(0xE0, 0xB6)
        return 0


@pytest.mark.parametrize('how', [0, 1, 2])
def test_a_transfer_that_is_not_yielded_is_an_error(how: int) -> None:
    with i2c_rig(SimulatedBmp280, Forgetful) as rig:
        rig.device.how = how
        text = rig.run_until_error(10)
        assert 'dut: its driver is defective' in text and 'was made and not yielded' in text


def test_a_step_may_look_after_its_errors_itself() -> None:
    class Prober(Bmp280):
        seen = ''

        def begin(self, now_ns: int) -> Any:
            try:
                yield Transfer(0x33, b'\0', 1)
            except DeviceError as error:
                self.seen = str(error)
            assert (yield self.fetch(0xD0, 1)) == b'\x58'
            return self.then(super().begin, now_ns)

    with i2c_rig(SimulatedBmp280, Prober) as rig:
        assert rig.run(500) > 0
        assert 'address 0x33: no device answers' in rig.device.seen


# --- real processes ------------------------------------------------------------------------------

SLOW_BUS = """
import os, time
class I2cFunc:
    I2C = 1
class i2c_msg(list):
    @staticmethod
    def write(address, data): return i2c_msg(data)
    @staticmethod
    def read(address, size): return i2c_msg([0x58] * size)
class SMBus:
    funcs = 1
    def open(self, path): self.fd = os.open(path, os.O_RDWR)
    fd = None
    def close(self): self.fd is None or os.close(self.fd)
    def i2c_rdwr(self, *messages): time.sleep(SECONDS)
"""


@pytest.fixture
def real_bus(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[float], Any]]:
    """Give buses of a real path, whose adapter is a stub that takes its time."""
    made = I2cBuses()

    def make(seconds: float) -> I2cBuses:
        (tmp_path / 'smbus2.py').write_text(SLOW_BUS.replace('SECONDS', repr(seconds)))
        monkeypatch.setenv('PYTHONPATH', f'{tmp_path}:{Path(__file__).parents[2]}')
        made.prepare('/dev/null')
        return made

    yield make
    made.close()


def test_a_real_bus_is_served_by_a_bridge(real_bus: Callable[[float], Any]) -> None:
    buses = real_bus(0.0)
    one, two = buses.take('/dev/null'), buses.take('/dev/null')
    assert transact(one, 0x76, b'\xd0', 1) == transact(two, 0x77, b'\xd0', 1) == b'\x58'
    bridge = buses._bridges['/dev/null']
    folder, pid = bridge.socket_path.parent, bridge._process.pid
    os.kill(pid, signal.SIGKILL)
    with pytest.raises(DeviceError, match='/dev/null, address 0x76: the bus is gone'):
        transact(one, 0x76, b'\xd0', 1)
    assert one.gone
    os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT)
    again = buses.take('/dev/null')
    assert transact(again, 0x76, b'\xd0', 1) == b'\x58'
    assert bridge._process.pid != pid and not folder.exists()
    folder, process = bridge.socket_path.parent, bridge._process
    for bus in (one, two, again):
        buses.give_back(bus)
    buses.close()
    assert process.returncode == 0 and not folder.exists()


def test_a_slow_bus_holds_up_nobody_else(real_bus: Callable[[float], Any]) -> None:
    # Below a task of a device whose transfers take 60 ms one of 100 Hz goes on: each of its jobs
    # runs. While the transfers were made in the loop it lost two of three.
    buses = real_bus(0.06)
    kernel = Kernel()
    device: Any = Bmp280('dut', settings_of(Bmp280, port='/dev/null'))
    device.buses = buses
    manager = SensorManager(kernel, Bus(kernel), Reports())
    managed = manager.add(device, rate_hz=100.0, priority=40, interrupt=True)
    below = kernel.add_task('below', lambda: None, priority=10, rate_hz=100.0)
    kernel.run(10**9)
    bus = device._bus
    manager.close()
    assert bus.transfers > 5
    statistics = below.statistics()
    assert statistics.missed == 0 and managed.task is not None
    assert managed.task.statistics().missed == 0


def test_why_a_bus_cannot_be_opened_comes_through_the_bridge(
        real_bus: Callable[[float], Any], tmp_path: Path) -> None:
    buses = real_bus(0.0)
    (tmp_path / 'smbus2.py').write_text(SLOW_BUS.replace(
        'self.fd = os.open(path, os.O_RDWR)', 'raise OSError(13, "no")'))
    buses.close()
    buses.prepare('/dev/null')
    bus = buses.take('/dev/null')
    with pytest.raises(DeviceError, match='^I2C bus /dev/null may not be opened: add the user'):
        transact(bus, 0x76, b'\xd0', 1)
    buses.give_back(bus)


def test_the_bridge_ends_with_the_process_that_started_it(tmp_path: Path) -> None:
    program = (
        'import os, signal, sys\n'
        'from rt_robot_os.drivers.i2c_bridge import I2cBridge\n'
        "bridge = I2cBridge('/dev/null')\n"
        'bridge.start(wait=True)\n'
        'print(bridge._process.pid, bridge.socket_path, flush=True)\n'
        'os.kill(os.getpid(), signal.SIGKILL)\n')
    done = subprocess.run([sys.executable, '-c', program], cwd=Path(__file__).parents[2],
                          stdout=subprocess.PIPE, text=True, timeout=60)
    pid, path = done.stdout.split()
    wait_until(lambda: not os.path.exists(os.path.dirname(path)))
    wait_until(lambda: not os.path.exists(f'/proc/{pid}'))
