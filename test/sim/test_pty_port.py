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


"""Does the plug of a simulated device behave like one: same path, no waiting, nothing left."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.sim.pty_port import PtyPort


def reader(port: PtyPort) -> int:
    return os.open(port.link, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)


def test_the_path_stays_the_same_when_it_is_plugged_in_again(tmp_path: Path) -> None:
    port = PtyPort(tmp_path / 'a' / 'imu')
    for _ in range(3):
        port.plug()
        port.plug()
        assert port.link.is_symlink()
        assert os.path.realpath(port.link).startswith('/dev/pts/')
        port.unplug()
        port.unplug()
        assert not os.path.lexists(port.link)
    assert os.listdir(tmp_path / 'a') == []


def test_without_a_reader_bytes_are_dropped_and_counted(tmp_path: Path) -> None:
    port = PtyPort(tmp_path / 'imu')
    port.write(b'unplugged')
    port.plug()
    assert not port.has_reader()
    port.write(b'nobody')
    assert (port.bytes_sent, port.bytes_dropped) == (0, 15)
    descriptor = reader(port)
    assert port.has_reader()
    port.write(b'somebody')
    os.close(descriptor)
    assert not port.has_reader()
    port.write(b'nobody')
    assert (port.bytes_sent, port.bytes_dropped) == (8, 21)
    port.unplug()


def test_a_reader_that_does_not_read_blocks_nobody(tmp_path: Path) -> None:
    port = PtyPort(tmp_path / 'imu')
    port.plug()
    descriptor = reader(port)
    for _ in range(200):
        port.write(bytes(1000))
    assert port.bytes_sent + port.bytes_dropped == 200_000
    assert port.bytes_dropped > 100_000
    os.close(descriptor)
    port.unplug()


def test_bytes_are_not_changed_on_their_way_even_for_a_plain_reader(tmp_path: Path) -> None:
    port = PtyPort(tmp_path / 'imu')
    port.plug()
    descriptor = os.open(port.link, os.O_RDWR | os.O_NOCTTY)
    every_byte = bytes(range(256))
    port.write(every_byte)
    received = b''
    while len(received) < 256:
        received += os.read(descriptor, 300)
    assert received == every_byte
    assert port.read() == b''
    os.close(descriptor)
    port.unplug()


def test_a_link_left_over_is_replaced_and_a_file_is_not(tmp_path: Path) -> None:
    (tmp_path / 'old').symlink_to('/dev/pts/there-is-none')
    old = PtyPort(tmp_path / 'old')
    old.plug()
    assert os.path.exists(tmp_path / 'old')
    old.unplug()
    (tmp_path / 'file').write_text('precious')
    with pytest.raises(DeviceError, match='file cannot be made .*choose another folder'):
        PtyPort(tmp_path / 'file').plug()
    assert (tmp_path / 'file').read_text() == 'precious'


def test_a_folder_that_cannot_be_made_is_an_error(tmp_path: Path) -> None:
    (tmp_path / 'file').write_text('')
    with pytest.raises(DeviceError, match='choose another folder'):
        PtyPort(tmp_path / 'file' / 'imu').plug()


def test_the_link_of_another_is_not_removed(tmp_path: Path) -> None:
    one, two = PtyPort(tmp_path / 'imu'), PtyPort(tmp_path / 'imu')
    one.plug()
    two.plug()
    one.unplug()
    assert os.path.exists(two.link)
    two.unplug()
    assert os.listdir(tmp_path) == []
