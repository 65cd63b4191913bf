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

"""Test doubles: ports that return the bytes of a test, publishers that record samples."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
from contextlib import contextmanager
import select
from typing import Any

import pytest
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.schema import REQUIRED
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.devices.device import Device
from rt_robot_os.modules import Module
from rt_robot_os.topics import Layout


# By type and fixed fields: a suite makes thousands of publishers of a few kinds.
_LAYOUTS: dict[tuple[str, str], Layout] = {}


def _layout(publication: TopicSpec) -> Layout:
    key = (publication.message, repr((publication.fixed, publication.tail)))
    if key not in _LAYOUTS:
        _LAYOUTS[key] = Layout.compile(publication.message, publication.fixed,
                                       tail=publication.tail)
    return _LAYOUTS[key]


class RecordingPublisher:
    """
    The publisher of a driver, without a kernel: it records samples.

    :ivar msg: the message to fill in; it keeps its values, as in the robot.
    :ivar layout: the fields of the message.
    :ivar samples: the published ones, each a view with the names of the ROS message.
    :ivar stamps: their stamps in nanoseconds.
    :ivar values: their bytes.
    """

    def __init__(self, publication: TopicSpec) -> None:
        self.publication = publication
        self.layout = _layout(publication)
        self._buffer = self.layout.new_buffer()
        self.msg: Any = self.layout.view(self._buffer)
        self.samples: list[Any] = []
        self.stamps: list[int] = []
        self.values: list[bytes] = []

    def fill(self, data: memoryview) -> None:
        """Set the tail, or the longest sequence, of ``msg``."""
        octets = memoryview(data).cast('B')
        start = self.layout.bulk[0]
        self._buffer[start:start + len(octets)] = octets
        self.layout.set_tail_bytes(self._buffer, len(octets))

    def publish(self, stamp_ns: int) -> None:
        """Record the content of ``msg``."""
        copy = self.layout.new_buffer()
        copy[:] = self._buffer
        self.samples.append(self.layout.view(copy))
        self.stamps.append(stamp_ns)
        self.values.append(bytes(copy))


class ScriptedPort:
    """A port that returns chunks in order, then nothing; for tests without a real pty."""

    chunks: Sequence[bytes] = ()

    def __init__(self, path: str, baud: int | None) -> None:
        self.path = path
        self.bytes_read = 0
        self.dropped_write_bytes = 0
        self.written: list[bytes] = []
        self._left = list(self.chunks)

    def fileno(self) -> int:
        """Return a number; nothing waits on it."""
        return 0

    def read(self) -> bytes:
        """Return the next chunk."""
        data = self._left.pop(0) if self._left else b''
        self.bytes_read += len(data)
        return data

    def write(self, data: bytes) -> None:
        """Record the bytes of the driver."""
        self.written.append(data)

    def close(self) -> None:
        """Do nothing."""


def settings_of(kind: type[Device] | type[Module], /, **changes: Any) -> dict[str, Any]:
    """
    Return the default settings of a driver or a module, with changes.

    :raises AssertionError: a setting is unknown, or a value is invalid.
    """
    fields = kind.fields()
    values: dict[str, Any] = {f.name: f.default for f in fields}
    unknown = set(changes) - set(values)
    assert not unknown, (f'{kind.__name__} has no setting {", ".join(sorted(unknown))}: it has '
                         f'{", ".join(values)}')
    values.update(changes)
    missing = [name for name, value in values.items() if value is REQUIRED]
    assert not missing, f'{kind.__name__} needs a value for {", ".join(missing)}'
    for field in fields:
        problem = field.problem(values[field.name])
        assert problem is None, f'{field.name} = {values[field.name]!r}: must be {problem}'
    return values


def bind(device: Device) -> list[Any]:
    """Bind recording publishers to a device, and return them."""
    publishers = [RecordingPublisher(p) for p in device.publications()]
    device.bind(publishers)
    return publishers


@contextmanager
def opened(device: Device, chunks: Sequence[bytes]) -> Iterator[None]:
    """Open a serial device on a port that returns these chunks, one per read."""
    given: Any = device  # a serial device with any frames
    given.make_port = type('Port', (ScriptedPort,), {'chunks': chunks})
    device.open()
    yield
    device.close()


@contextmanager
def scripted(driver: type[Device], chunks: Sequence[bytes], **changes: Any
             ) -> Iterator[tuple[Any, list[Any]]]:
    """
    Open a serial device whose port returns these chunks, one per read.

    :param changes: settings other than the defaults.
    :return: the device, and a :class:`RecordingPublisher` for each of its publications.
    """
    device = driver('dut', settings_of(driver, **scripted_settings(changes)))
    publishers = bind(device)
    with opened(device, chunks):
        yield device, publishers


def scripted_settings(changes: Mapping[str, Any]) -> dict[str, Any]:
    """Add a port to settings: without a speed no frame is back-dated."""
    return {'port': 'scripted', 'baud': 0, **changes}


def read_all(device: Device, chunks: int, now_ns: int = 1_000_000_000, step_ns: int = 0) -> int:
    """Read once per chunk, and further while bytes wait for a later job."""
    serial: Any = device
    samples = 0
    for i in range(chunks):
        samples += device.read(now_ns + i * step_ns)
        while serial.waiting_bytes:
            samples += device.read(now_ns + i * step_ns)
    return samples


def wait_readable(device: Device, seconds: float = 5.0) -> None:
    """Wait until the port has bytes; a pty delivers them with a delay."""
    descriptor = device.fileno()
    assert descriptor is not None
    assert select.select([descriptor], [], [], seconds)[0], 'nothing arrived'


def read_until(device: Device, bytes_read: int, now_ns: int = 1_000_000_000) -> int:
    """Read from a real port until that many bytes have been read."""
    samples = 0
    while device.statistics().bytes_read < bytes_read:
        wait_readable(device)
        samples += device.read(now_ns)
    return samples


def wait_for_device_error(device: Device) -> DeviceError:
    """Read until the device raises DeviceError."""
    with pytest.raises(DeviceError) as caught:
        for _ in range(100):
            wait_readable(device)
            device.read(1_000_000_000)
    return caught.value
