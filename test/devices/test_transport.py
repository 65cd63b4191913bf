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


"""Does the serial port say what is wrong, never block, and lose nothing silently."""

from __future__ import annotations

from collections.abc import Iterator
import errno
import os
from pathlib import Path
import resource
import select
import subprocess
import sys
from typing import Any

import pytest
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.devices.serial import transport
from rt_robot_os.devices.serial.transport import SerialPort
from rt_robot_os.sim.pty_port import PtyPort


@pytest.fixture
def plug(tmp_path: Path) -> Any:
    port = PtyPort(tmp_path / 'port')
    port.plug()
    yield port
    port.unplug()


@pytest.fixture
def one_cpu() -> Iterator[None]:
    """Where Linux can hand on bytes only while this thread waits."""
    cpus = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(cpus)})
    yield
    os.sched_setaffinity(0, cpus)


def read_exactly(port: SerialPort, count: int) -> bytes:
    data = b''
    while len(data) < count:
        assert select.select([port.fileno()], [], [], 5)[0]
        data += port.read()
    return data


@pytest.mark.parametrize('baud', [None, 0, 9600, 115200, 250000])
def test_bytes_go_both_ways(plug: PtyPort, baud: int | None) -> None:
    port = SerialPort(str(plug.link), baud)
    every_byte = bytes(range(256))
    plug.write(every_byte)
    assert read_exactly(port, 256) == every_byte
    assert port.bytes_read == 256
    port.write(every_byte)
    assert select.select([plug.fileno()], [], [], 5)[0]
    assert plug.read() == every_byte
    port.close()


def test_reading_nothing_does_not_block_and_is_no_error(plug: PtyPort) -> None:
    port = SerialPort(str(plug.link), None)
    assert [port.read() for _ in range(3)] == [b''] * 3
    port.close()


def test_what_was_sent_last_arrives_although_the_port_is_closed(plug: PtyPort) -> None:
    poll = select.poll()
    poll.register(plug.fileno(), select.POLLIN)
    for number in range(100):
        port = SerialPort(str(plug.link), None)
        order = b'stop %d\r' % number
        port.write(order)
        port.close()
        assert any(events & select.POLLIN for _, events in poll.poll(5000)), number
        assert plug.read() == order


def test_a_port_that_takes_nothing_is_closed_all_the_same(plug: PtyPort) -> None:
    port = SerialPort(str(plug.link), None)
    while not port.dropped_write_bytes:
        port.write(bytes(1000))
    port.close()
    assert port.fileno() == -1


def test_a_full_buffer_is_read_at_once(plug: PtyPort) -> None:
    port = SerialPort(str(plug.link), None)
    data = bytes(range(250)) * 60
    plug.write(data)
    sent = plug.bytes_sent
    assert sent > 4096
    assert read_exactly(port, sent) == data[:sent]
    port.close()


@pytest.mark.parametrize('end', [b'', OSError(errno.EIO, 'gone')])
def test_what_came_before_the_unplugging_is_not_lost(
    end: Any, plug: PtyPort, monkeypatch: pytest.MonkeyPatch,
) -> None:
    port = SerialPort(str(plug.link), None)
    chunks = [bytes(4095), bytes(4096), bytes(10), bytes(4095), end, end]

    def read(descriptor: int, size: int) -> bytes:
        chunk = chunks.pop(0)
        if isinstance(chunk, OSError):
            raise chunk
        return chunk

    with monkeypatch.context() as patch:
        patch.setattr(transport.os, 'read', read)
        patch.setattr(transport, 'unread_bytes', lambda fd: 1)
        assert len(port.read()) == 4095 + 4096 + 10
        assert len(port.read()) == 4095
        with pytest.raises(DeviceError, match='is gone'):
            port.read()
    assert port.bytes_read == 2 * 4095 + 4096 + 10
    port.close()


def test_one_read_is_bounded(plug: PtyPort, monkeypatch: pytest.MonkeyPatch) -> None:
    port = SerialPort(str(plug.link), None)
    with monkeypatch.context() as patch:
        patch.setattr(transport.os, 'read', lambda descriptor, size: bytes(size))
        patch.setattr(transport, 'unread_bytes', lambda fd: 1)
        assert len(port.read()) == 65536
    port.close()


def test_a_read_does_not_wait_for_bytes_that_linux_has_not_handed_on(
        plug: PtyPort, one_cpu: None) -> None:
    port = SerialPort(str(plug.link), None)
    waits = 0
    sent = b''
    received = b''
    for number in range(200):
        first, second = b'a%d ' % number, b'b%d ' % number
        plug.write(first)
        sent += first + second
        received += read_exactly(port, len(sent) - len(received) - len(second))
        plug.write(second)  # on its way: a worker of Linux has been told a moment ago
        before = resource.getrusage(resource.RUSAGE_THREAD).ru_nvcsw
        received += port.read()
        waits += resource.getrusage(resource.RUSAGE_THREAD).ru_nvcsw - before
        received += read_exactly(port, len(sent) - len(received))
    assert received == sent
    # Linux may take turns for a moment while its worker hands bytes on.
    assert waits <= 20
    port.close()


def test_what_came_while_nobody_read_is_all_there(plug: PtyPort) -> None:
    port = SerialPort(str(plug.link), None)
    parts = [bytes(range(number, number + 40)) for number in range(50)]
    for part in parts:
        plug.write(part)
    assert read_exactly(port, 2000) == b''.join(parts)
    assert port.read() == b''
    port.close()


def test_what_was_on_its_way_before_the_port_was_opened_is_discarded(plug: PtyPort) -> None:
    for _ in range(50):
        other = os.open(plug.link, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        plug.write(b'old')
        port = SerialPort(str(plug.link), None)
        plug.write(b'new')
        assert read_exactly(port, 3) == b'new'
        port.close()
        os.close(other)


def test_unplugging_is_an_error_for_reading_and_for_writing(plug: PtyPort) -> None:
    port = SerialPort(str(plug.link), None)
    plug.unplug()
    with pytest.raises(DeviceError, match='is gone .* check the cable'):
        port.read()
    with pytest.raises(DeviceError, match='is gone .* check the cable'):
        port.write(b'x')
    port.close()
    port.close()
    assert port.fileno() == -1
    with pytest.raises(DeviceError, match='is gone'):
        port.read()


def test_what_the_port_does_not_take_is_kept_and_sent_later(plug: PtyPort) -> None:
    port = SerialPort(str(plug.link), None)
    commands = [b'%05d;' % i for i in range(20_000)]
    accepted = []
    for command in commands:
        before = port.dropped_write_bytes
        port.write(command)
        if port.dropped_write_bytes == before:
            accepted.append(command)
        if port.dropped_write_bytes > 600:
            break
    assert port.dropped_write_bytes % 6 == 0
    assert port.dropped_write_bytes > 0
    received = b''
    expected = b''.join(accepted)
    while len(received) < len(expected):
        received += plug.read()
        port.write(b'')
    assert received == expected
    port.close()


def test_a_second_opener_is_told_who_has_the_port(plug: PtyPort) -> None:
    port = SerialPort(str(plug.link), None)
    with pytest.raises(DeviceError, match='in use by another device of this program: stop it'):
        SerialPort(str(plug.link), None)
    port.close()
    SerialPort(str(plug.link), None).close()


def test_another_program_that_has_the_port_is_named(plug: PtyPort) -> None:
    code = ('import fcntl, sys; f = open(sys.argv[1], "rb", buffering=0); '
            'fcntl.flock(f, fcntl.LOCK_EX); print("has it", flush=True); sys.stdin.read()')
    with subprocess.Popen([sys.executable, '-c', code, str(plug.link)], stdin=subprocess.PIPE,
                          stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == b'has it\n'
        with pytest.raises(DeviceError, match=rf'in use by .*process {other.pid}'):
            SerialPort(str(plug.link), None)
        other.communicate()


def test_a_real_port_is_closed_to_others_and_open_again_afterwards(
    plug: PtyPort, monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(transport, '_PTY_SLAVE_MAJORS', ())
    for _ in range(2):
        port = SerialPort(str(plug.link), None)
        port.close()
    monkeypatch.undo()
    SerialPort(str(plug.link), None).close()


@pytest.mark.parametrize('number, remedy', [
    (errno.ENOENT, 'check the cable and the path'), (errno.ENXIO, 'check the cable'),
    (errno.EACCES, 'add the user to the group dialout'), (errno.EBUSY, 'in use by'),
    (errno.ENOMEM, 'check path and baud')])
def test_each_cause_has_its_remedy(
    number: int, remedy: str, monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refuse(*_: Any, **__: Any) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(transport.serial, 'Serial', refuse)
    with pytest.raises(DeviceError, match=f'/dev/null.*{remedy}'):
        SerialPort('/dev/null', 9600)


@pytest.mark.parametrize('path', ['', '/', '/dev/null', __file__, '/dev/null/x', 'a\0b'])
def test_what_is_no_serial_port_is_refused(path: str) -> None:
    with pytest.raises(DeviceError, match='port .*: '):
        SerialPort(path, 9600)


@pytest.mark.parametrize('baud', [-1, 10**12])
def test_an_impossible_speed_is_refused(plug: PtyPort, baud: int) -> None:
    with pytest.raises(DeviceError, match='change the baud|check path and baud'):
        SerialPort(str(plug.link), baud)
