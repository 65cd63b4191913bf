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


"""Do the commands simulator and player start, obey, and leave nothing behind."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import select
import signal
import subprocess
import sys
from typing import Any

import pytest
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.core import simulator_program as program
from rt_robot_os.devices.i2c.socket_bus import SocketTransport
from rt_robot_os.devices.nmea.wire import NmeaDecoder
from rt_robot_os.devices.witmotion.wire import WitMotionDecoder
from rt_robot_os.sim import player_program
from rt_robot_os.sim.pty_port import PtyPort
from rt_robot_os.sim.server import SimServer

ROOT = Path(__file__).parents[2]
RUN = 'import sys; from rt_robot_os.{} import main; sys.exit(main())'
SIMULATOR = 'core.simulator_program'


@contextmanager
def running(command: str, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Run a command as a process of its own."""
    process = subprocess.Popen(
        [sys.executable, '-c', RUN.format(command), *arguments], cwd=ROOT, text=True,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    try:
        yield process
    finally:
        if process.poll() is None:
            process.terminate()
        process.communicate(timeout=60)


def read_some(path: str, count: int) -> bytes:
    descriptor = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    data = b''
    while len(data) < count:
        assert select.select([descriptor], [], [], 20)[0], 'nothing arrived'
        part = os.read(descriptor, 4096)
        assert part, 'unplugged'
        data += part
    os.close(descriptor)
    return data


class Lines:
    """Lines of a pipe, each waited for; the pipe's own buffer would hide them from select."""

    def __init__(self, stream: Any) -> None:
        self._descriptor = stream.fileno()
        self._data = b''

    def next_line(self) -> str:
        while b'\n' not in self._data:
            assert select.select([self._descriptor], [], [], 20)[0], 'no line arrived'
            self._data += os.read(self._descriptor, 4096)
        line, _, self._data = self._data.partition(b'\n')
        return line.decode()


class FakeDevice:
    """Notes when it was pumped."""

    def __init__(self, period_ns: int, broken: bool = False) -> None:
        self.port = PtyPort('/nowhere')
        self.pumped: list[int] = []
        self.closed = 0
        self._period_ns = period_ns
        self._broken = broken

    def pump(self, now_ns: int) -> None:
        self.pumped.append(now_ns)
        if self._broken:
            raise DeviceError('no pty left')

    def next_event_ns(self) -> int:
        return (self.pumped[-1] // self._period_ns + 1) * self._period_ns

    def close(self) -> None:
        self.closed += 1


def test_the_server_waits_for_the_device_that_is_due_first() -> None:
    devices = [FakeDevice(3000), FakeDevice(5000)]
    server = SimServer(devices)
    assert server.step(1) == 3000
    assert server.step(3000) == 5000
    assert server.step(5000) == 6000
    server.close()
    server.close()
    assert devices[0].closed


def test_a_device_that_fails_is_told_once_and_disturbs_no_other() -> None:
    good, reports = FakeDevice(1000), []
    server = SimServer([FakeDevice(1000, broken=True), good], report=reports.append)
    for now in range(5):
        server.step(now)
    assert len(good.pumped) == 5
    assert reports == ['no pty left']
    assert server.problem_count == 5
    server.close()


def test_the_server_runs_until_it_is_stopped_and_unplugs() -> None:
    device = FakeDevice(1_000_000)
    server = SimServer([device])
    started = []
    server.run(on_start=lambda: started.append(True), until=lambda: len(device.pumped) >= 5)
    assert started == [True]
    assert device.closed == 1
    stopped = SimServer([device])
    stopped.stop()
    stopped.run()
    assert len(device.pumped) == 5


def test_lines_come_whole_and_the_end_of_input_is_no_end() -> None:
    read_end, write_end = os.pipe()
    device, lines = FakeDevice(1_000_000), []
    server = SimServer([device])
    server.read_lines(read_end, lines.append)
    parts = [b'imu si', b'lent 3\ngps', b' stuck 1\n', None]

    def next_part() -> bool:
        if parts:
            part = parts.pop(0)
            if part is None:
                os.close(write_end)
            else:
                os.write(write_end, part)
        return len(lines) == 2 and len(device.pumped) > 20

    server.run(until=next_part)
    assert lines == ['imu silent 3', 'gps stuck 1']
    os.close(read_end)


def test_simulator(tmp_path: Path) -> None:
    with running(SIMULATOR, 'imu:witmotion', 'gps:nmea', '--dir', str(tmp_path), '--rate',
                 'gps=10', '--baud', 'gps=115200') as process:
        output, errors = Lines(process.stdout), Lines(process.stderr)
        paths = dict(output.next_line().split() for _ in range(2))
        assert paths == {'imu': str(tmp_path / 'imu'), 'gps': str(tmp_path / 'gps')}
        assert len(WitMotionDecoder().feed(read_some(paths['imu'], 300))) > 20
        assert len(NmeaDecoder().feed(read_some(paths['gps'], 300))) >= 2
        assert process.stdin is not None
        process.stdin.write('imu lightning 3\nnonsense\ncar silent 1\nimu silent x\n\n')
        process.stdin.flush()
        complaints = [errors.next_line() for _ in range(4)]
        assert 'no fault' in complaints[0]
        assert all('write DEVICE FAULT SECONDS' in c and 'imu, gps' in c for c in complaints[1:])
        # Opened before it is unplugged: then it ends for whoever has it open.
        descriptor = os.open(paths['imu'], os.O_RDWR | os.O_NOCTTY)
        process.stdin.write('imu unplug 0.2\n')
        process.stdin.close()
        process.stdin = None
        with pytest.raises(OSError):
            while os.read(descriptor, 4096):
                pass
            raise OSError('end of file')
        os.close(descriptor)
        process.send_signal(signal.SIGTERM)
        _, rest = process.communicate(timeout=60)
        assert (process.returncode, rest) == (0, '')
    assert os.listdir(tmp_path) == []


def test_simulator_of_chips_on_one_bus(tmp_path: Path) -> None:
    with running(SIMULATOR, 'imu:mpu6050', 'baro:bmp280', '--dir', str(tmp_path)) as process:
        output = Lines(process.stdout)
        paths = dict(output.next_line().split() for _ in range(2))
        assert paths == {'imu': str(tmp_path / 'imu'), 'baro': str(tmp_path / 'baro')}
        bus = SocketTransport(paths['imu'])
        assert bus.transfer(0x68, b'\x75', 1) == b'\x68'
        assert bus.transfer(0x76, b'\xd0', 1) == b'\x58'
        assert process.stdin is not None
        process.stdin.write('baro nack 600\nbaro short 1\n')
        process.stdin.flush()
        assert "no fault 'short': use one of silent" in Lines(process.stderr).next_line()
        with pytest.raises(OSError, match='Remote I/O'):
            while True:
                bus.transfer(0x76, b'\xd0', 1)
        assert bus.transfer(0x68, b'\x75', 1) == b'\x68'
        bus.close()
        process.send_signal(signal.SIGTERM)
        assert process.wait(timeout=60) == 0
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGHUP])
def test_other_signals_end_it_too(number: int, tmp_path: Path) -> None:
    with running(SIMULATOR, 'imu:witmotion', '--dir', str(tmp_path)) as process:
        Lines(process.stdout).next_line()
        read_some(str(tmp_path / 'imu'), 30)
        process.send_signal(number)
        assert process.wait(timeout=60) == 0
    assert os.listdir(tmp_path) == []


def test_it_ends_with_the_process_that_started_it(tmp_path: Path) -> None:
    # The one in between ends as soon as the simulator has begun; the simulator alone keeps the
    # pipe open from then on.
    code = ('import subprocess, sys\n'
            'child = subprocess.Popen([sys.executable, "-c", *sys.argv[2:]], text=True,\n'
            '    stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, pass_fds=[int(sys.argv[1])])\n'
            'child.stdout.readline()\n'
            'open(sys.argv[-1] + "/imu", "rb", buffering=0).read(1)\n')
    read_end, write_end = os.pipe()
    subprocess.run(
        [sys.executable, '-W', 'ignore', '-c', code, str(write_end), RUN.format(SIMULATOR),
         'imu:witmotion', '--dir', str(tmp_path)], cwd=ROOT, pass_fds=[write_end], timeout=60,
        check=True)
    os.close(write_end)
    assert select.select([read_end], [], [], 20)[0], 'it is still there'
    assert os.read(read_end, 1) == b''
    os.close(read_end)
    assert os.listdir(tmp_path) == []


def test_player(tmp_path: Path) -> None:
    log = tmp_path / 'x.log'
    log.write_bytes(b'# note\n' + b'$GPVTG,1*00\r\n' * 20)
    link = tmp_path / 'gps'
    with running('sim.player_program', str(log), '--link', str(link), '--baud', '115200',
                 '--wait') as process:
        assert Lines(process.stdout).next_line() == str(link)
        assert read_some(str(link), 260) == b'$GPVTG,1*00\r\n' * 20
        assert process.wait(timeout=60) == 0
    assert not os.path.lexists(link)


@pytest.mark.parametrize('arguments, messages', [
    (['imu'], ["device 'imu' is not understood"]),
    (['imu:lidar'], ["no simulated device for the driver 'lidar': use one of "]),
    (['a:nmea', 'a:nmea', '../b:nmea'], ["two devices with the name 'a'", "'../b:nmea'"]),
    (['a:nmea', '--baud', 'fast', '--rate', 'b=1', '--fault', 'x', '--fault', 'a: y at 1 for 1'],
     ["--baud 'fast'", "no device 'b'", "--fault 'x'", "no fault 'y'"]),
    (['a:nmea', '--rate', '40'], ['lower rate_hz or raise baud']),
    (['a:nmea', '--rate', '0'], ['a: rate_hz is 0.0: it must be a number from 0.01'])])
def test_wrong_arguments_are_all_told_and_nothing_is_made(
    arguments: list[str], messages: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    assert program.main([*arguments, '--dir', str(tmp_path / 'd')]) == 2
    errors = capsys.readouterr().err
    assert all(m in errors for m in messages), errors
    assert not (tmp_path / 'd').exists()


def test_without_a_folder_to_be_found_it_has_to_be_given(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.delenv('XDG_RUNTIME_DIR', raising=False)
    assert program.main(['imu:witmotion']) == 2
    assert '--dir' in capsys.readouterr().err


def test_a_folder_that_cannot_be_made_and_a_log_that_is_not_there(
    tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / 'file').write_text('')
    assert program.main(['imu:witmotion', '--dir', str(tmp_path / 'file')]) == 2
    assert 'choose another folder' in capsys.readouterr().err
    assert player_program.main([str(tmp_path / 'none'), '--link', str(tmp_path / 'x')]) == 2
    assert 'check the path' in capsys.readouterr().err
