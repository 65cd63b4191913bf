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

"""The bridge: transactions of a socket on a bus, its errors, a bus that goes and comes back."""

from __future__ import annotations

from collections.abc import Iterator
import errno
import os
from pathlib import Path
import signal
import subprocess
import sys
import threading

import pytest
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.devices.bmp280.simulated import SimulatedBmp280
from rt_robot_os.devices.i2c import real_bus
from rt_robot_os.devices.i2c.packets import NO_BUS
from rt_robot_os.devices.i2c.program import main
from rt_robot_os.devices.i2c.simulated_port import I2cPort
from rt_robot_os.devices.i2c.socket_bus import SocketTransport
from rt_robot_os.sim.server import SimServer

ROOT = Path(__file__).parents[2]


class Real:
    """Stands for a real bus."""

    def __init__(self, *errors: int) -> None:
        self.errors = list(errors)
        self.closed = 0

    def transfer(self, address: int, data: bytes, size: int) -> bytes:
        if self.errors:
            number = self.errors.pop(0)
            raise OSError(number, os.strerror(number))
        return bytes((address,)) * size

    def close(self) -> None:
        self.closed += 1


def test_errors_are_handed_on_and_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    real = Real(errno.EREMOTEIO, errno.ETIMEDOUT)
    monkeypatch.setattr(real_bus, 'open_transport', lambda path: real)
    bridge = real_bus.RealBus('/dev/i2c-1')
    assert bridge.transfer(0x20, b'', 2, 0) == (errno.EREMOTEIO, b'Remote I/O error', 0)
    assert bridge.transfer(0x20, b'', 2, 0) == (errno.ETIMEDOUT, b'Connection timed out', 0)
    assert bridge.transfer(0x20, b'', 2, 0) == (0, b'  ', 0)
    assert (bridge.transfers, bridge.failures) == (1, 2)
    bridge.close()
    bridge.close()
    assert real.closed == 1


def test_a_bus_that_goes_away_is_opened_again(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[Real] = []
    there = True

    def opener(path: str) -> Real:
        if not there:
            raise DeviceError('it does not exist')
        opened.append(Real(*[errno.ENODEV] * (not opened)))
        return opened[-1]

    monkeypatch.setattr(real_bus, 'open_transport', opener)
    bridge = real_bus.RealBus('/dev/i2c-1')
    bridge.open()
    there = False
    assert bridge.transfer(0x20, b'', 1, 0)[0] == errno.ENODEV
    assert bridge.transfer(0x20, b'', 1, 0) == (NO_BUS, b'it does not exist', 0)
    assert opened[0].closed == 1
    there = True
    assert bridge.transfer(0x20, b'', 1, 0) == (0, b' ', 0)
    assert len(opened) == 2


def test_a_bus_that_cannot_be_opened(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(['/dev/i2c-991', '--socket', str(tmp_path / 'x')]) == 2
    assert 'I2C bus /dev/i2c-991 does not exist: ls /dev/i2c-' in capsys.readouterr().err
    assert os.listdir(tmp_path) == []


@pytest.fixture
def chip(tmp_path: Path) -> Iterator[Path]:
    port = I2cPort(tmp_path / 'i2c-sim')
    device = SimulatedBmp280('baro', {}, port)
    port.plug()
    server = SimServer([device])
    thread = threading.Thread(target=server.run)
    thread.start()
    yield device.path
    server.stop()
    thread.join(10)


@pytest.mark.parametrize('signo', [signal.SIGTERM, signal.SIGINT])
def test_the_program(chip: Path, signo: int, tmp_path: Path) -> None:
    # The bus behind it is an emulated one; what it does with it is what it does with a real one.
    path = tmp_path / 'bridge'
    process = subprocess.Popen(
        [sys.executable, '-m', 'rt_robot_os.devices.i2c.program', str(chip), '--socket', str(path),
         '--priority', '0'], cwd=ROOT, text=True, stdout=subprocess.PIPE)
    assert process.stdout is not None
    assert process.stdout.readline() == f'{path}\n'
    transport = SocketTransport(str(path))
    assert transport.transfer(0x76, b'\xd0', 1) == b'\x58'
    with pytest.raises(OSError, match='Remote I/O'):
        transport.transfer(0x11, b'\xd0', 1)
    process.send_signal(signo)
    process.communicate(timeout=60)
    assert process.returncode == 0
    with pytest.raises(OSError):
        transport.transfer(0x76, b'\xd0', 1)
    transport.close()
    assert not path.exists()
