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

"""The process that serves a bus: one that stands still, the bridge to a real bus, late answers."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
import os
from pathlib import Path
import re
import signal
import socket
import subprocess
import sys
from typing import Any

from driver_fakes import bind
from driver_fakes import settings_of
from i2c_bench import i2c_rig
from i2c_bench import transact
from i2c_bench import wait_until
import pytest
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.reports import Reports
from rt_robot_os.devices.bmp280.driver import Bmp280
from rt_robot_os.devices.bmp280.simulated import SimulatedBmp280
from rt_robot_os.devices.i2c import packets as i2c_packets
from rt_robot_os.devices.i2c.bus import I2cBuses
from rt_robot_os.devices.i2c.bus import Transfer
from rt_robot_os.devices.i2c.simulated_port import I2cPort
from rt_robot_os.devices.i2c.socket_bus import SocketConnection
from rt_robot_os.devices.manager import SensorManager
from rt_robot_os.devices.mpu6050.driver import Mpu6050
from rt_robot_os.kernel import Kernel
from rt_robot_os.topics import Bus
from took_little import took_little


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


def test_answers_without_end_are_looked_at_in_parts(tmp_path: Path) -> None:
    # 30 of them, then the right one: each look takes some, and ends.
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listener:
        listener.bind(str(tmp_path / 'bus'))
        listener.listen()
        connection = SocketConnection(str(tmp_path / 'bus'))
        server = listener.accept()[0]
        connection.begin(0x76, b'', 1)
        number = i2c_packets.parse_request(server.recv(100))
        assert number is not None
        for late in (*range(30_000, 30_030), number[0]):
            server.send(i2c_packets.answer(late, 0, b'x'))
        looks = 1
        while connection.answer() is None:
            looks += 1
        assert looks == 4
        server.close()
    connection.close()


def test_too_many_that_wait_for_a_process_is_an_error_not_a_wait(tmp_path: Path) -> None:
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    listener.bind(str(tmp_path / 'bus'))
    listener.listen(1)
    buses, taken = I2cBuses(), []
    with pytest.raises(DeviceError, match='too many connections wait for the process that serves'):
        for _ in range(20):
            taken.append(buses.acquire(str(tmp_path / 'bus')))
    for bus in taken:
        buses.release(bus)
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
        monkeypatch.setenv('PYTHONPATH', os.pathsep.join(
            [str(tmp_path), str(Path(__file__).parents[2]), os.environ.get('PYTHONPATH', '')]))
        made.prepare('/dev/null')
        return made

    yield make
    made.close()


def test_a_real_bus_is_served_by_a_bridge(real_bus: Callable[[float], Any]) -> None:
    buses = real_bus(0.0)
    one, two = buses.acquire('/dev/null'), buses.acquire('/dev/null')
    assert transact(one, 0x76, b'\xd0', 1) == transact(two, 0x77, b'\xd0', 1) == b'\x58'
    bridge = buses._bridges['/dev/null']
    folder, pid = bridge.socket_path.parent, bridge._process.pid
    os.kill(pid, signal.SIGKILL)
    with pytest.raises(DeviceError, match='/dev/null, address 0x76: the bus is gone'):
        transact(one, 0x76, b'\xd0', 1)
    assert one.gone
    os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT)
    again = buses.acquire('/dev/null')
    assert transact(again, 0x76, b'\xd0', 1) == b'\x58'
    assert bridge._process.pid != pid and not folder.exists()
    folder, process = bridge.socket_path.parent, bridge._process
    for bus in (one, two, again):
        buses.release(bus)
    buses.close()
    assert process.returncode == 0 and not folder.exists()


def test_a_slow_bus_holds_up_nobody_else(real_bus: Callable[[float], Any]) -> None:
    # A device whose transfers take 60 ms leaves the time to others. While they were made in the
    # loop it took nearly all.
    buses = real_bus(0.06)
    kernel = Kernel()
    device: Any = Bmp280('dut', settings_of(Bmp280, port='/dev/null'))
    device.buses = buses
    manager = SensorManager(kernel, Bus(kernel), Reports())
    managed = manager.add(device, rate_hz=100.0, priority=40, interrupt=True)
    wanted = 0

    def look() -> None:
        if device._bus is not None and device._bus.transfers > wanted:
            kernel.stop('enough')

    kernel.add_task('below', look, priority=10, rate_hz=100.0)
    assert kernel.run(60 * 10**9) == 'enough', managed.reason  # the bridge has come up
    assert managed.task is not None
    managed.task.reset_statistics()
    wanted = device._bus.transfers + 5
    assert kernel.run(60 * 10**9) == 'enough', managed.reason
    assert took_little(kernel, managed.task)
    manager.close()


def test_why_a_bus_cannot_be_opened_comes_through_the_bridge(
        real_bus: Callable[[float], Any], tmp_path: Path) -> None:
    buses = real_bus(0.0)
    (tmp_path / 'smbus2.py').write_text(SLOW_BUS.replace(
        'self.fd = os.open(path, os.O_RDWR)', 'raise OSError(13, "no")'))
    buses.close()
    buses.prepare('/dev/null')
    bus = buses.acquire('/dev/null')
    with pytest.raises(DeviceError, match='^I2C bus /dev/null may not be opened: add the user'):
        transact(bus, 0x76, b'\xd0', 1)
    buses.release(bus)


def test_the_bridge_ends_with_the_process_that_started_it(tmp_path: Path) -> None:
    program = (
        'import os, signal, sys\n'
        'from rt_robot_os.devices.i2c.bridge import I2cBridge\n'
        "bridge = I2cBridge('/dev/null')\n"
        'bridge.start(wait=True)\n'
        'print(bridge._process.pid, bridge.socket_path, flush=True)\n'
        'os.kill(os.getpid(), signal.SIGKILL)\n')
    done = subprocess.run([sys.executable, '-c', program], cwd=Path(__file__).parents[2],
                          stdout=subprocess.PIPE, text=True, timeout=60)
    pid, path = done.stdout.split()
    wait_until(lambda: not os.path.exists(os.path.dirname(path)))
    wait_until(lambda: not os.path.exists(f'/proc/{pid}'))
