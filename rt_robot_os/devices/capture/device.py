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

"""
The core's side of a camera or a microphone: a device like others, whose port is a process.

It never captures itself. ``read`` receives the packets that name the slot of a new frame, copies
the frame into its topic in pieces of 64 KiB, and releases the slot. A process that hangs or dies,
or whose camera was unplugged, is a fault like any other: the next ``open`` starts another.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from collections.abc import Mapping
import os
from pathlib import Path
import socket
import stat
from typing import Any
from typing import ClassVar
from typing import Final

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.devices.capture import packets
from rt_robot_os.devices.capture.packets import CapturedFrame
from rt_robot_os.devices.capture.packets import PacketKind
from rt_robot_os.devices.capture.spawn import spawn_worker
from rt_robot_os.devices.device import Device
from rt_robot_os.devices.device import DeviceStatistics
from rt_robot_os.linux.memory_file import MemoryFile
from rt_robot_os.linux.memory_file import send_with_fd

SLOTS: Final = 3
SYNTHETIC: Final = 'synthetic'
_PACKETS_PER_READ: Final = 8
_ENDED: Final = ('its capture process ended without a message (a library crashed, or it was '
                 'killed); it is restarted')


def connect(path: str | os.PathLike[str]) -> socket.socket:
    """
    Connect to the host of the workers.

    :raises DeviceError: no process listens there.
    """
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    connection.setblocking(False)
    try:
        connection.connect(os.fspath(path))
    except OSError as error:
        connection.close()
        raise DeviceError(f'{os.fspath(path)}: {error.strerror or error}: the process that starts '
                          'captures is not running; check that the device is plugged in, or '
                          'restart the robot'
                          ) from error
    return connection


def is_socket(port: str) -> bool:
    """Return whether a port is a socket, such as that of a simulated camera."""
    try:
        return stat.S_ISSOCK(os.stat(port).st_mode)
    except (OSError, ValueError):
        return False


class CaptureDevice(Device):
    """
    A device that is captured in a separate process.

    :cvar SOURCE: what the worker captures, ``camera`` or ``sound``.

    It uses a service, the path of the socket of a
    :class:`~rt_robot_os.devices.capture.host.CaptureHost`; without it ``open`` starts the process
    itself, which takes a native call of up to 1 ms.
    """

    SOURCE: ClassVar[str] = ''
    SERVICES: ClassVar[tuple[str, ...]] = ('captures',)
    OPENING_S: ClassVar[float] = 10.0

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """Store the settings; nothing is opened."""
        super().__init__(name, settings)
        self._connection: socket.socket | None = None
        self._stop: Callable[[], object] | None = None
        self._memory: MemoryFile | None = None
        self._buffer = bytearray(packets.PACKET_BYTES_MAXIMUM)
        self._view = memoryview(self._buffer)
        self._ready = False
        self._bytes = self._frames = self._samples = self._rejected = self._last_ns = 0
        # Overruns of earlier workers, and of the current one.
        self._lost_before = self._lost = 0

    @abstractmethod
    def slot_bytes(self) -> int:
        """Return the largest size of a frame in bytes, all parts together."""

    @abstractmethod
    def handle(self, frame: CapturedFrame, data: memoryview) -> int:
        """
        Publish a frame; in the loop.

        :param data: the slot, valid during the call.
        :return: number of samples published.
        """

    def observe_ended(self, told: dict[str, Any], now_ns: int) -> None:
        """Handle the answer of the process to a request; in the loop."""

    def request(self, request: dict[str, Any]) -> str:
        """
        Send a request to the process; safe in the loop.

        :return: why it cannot be sent; empty if it was.
        """
        connection = self._connection
        if connection is None or not self._ready:
            return 'the camera is not open: see /diagnostics'
        try:
            connection.send(packets.encode_json(PacketKind.REQUEST, request))
        except BlockingIOError:
            return 'its process accepts no requests: it hangs'
        except OSError as error:
            return f'its process has ended: {error.strerror or error}'
        return ''

    def check(self) -> None:
        """
        Check the port before a process is started for it.

        :raises DeviceError: it cannot work.
        """

    def open(self) -> None:  # noqa: A003
        """
        Start the capture process; its problems are reported later, by :meth:`read`.

        :raises DeviceError: the process cannot be started.
        """
        self.close()
        port = self.settings['port']
        synthetic = is_socket(port)
        try:
            if not synthetic:
                self.check()
            self._memory = MemoryFile.create(f'rt_robot_os {self.name}', SLOTS, self.slot_bytes())
            self._connection = self._start(
                port if synthetic else self.services.get('captures'))
            allowed = os.sched_getaffinity(0)
            send_with_fd(self._connection, packets.encode_json(PacketKind.OPEN, {
                'source': self.SOURCE, 'name': self.name, 'slots': SLOTS,
                'slot_bytes': self.slot_bytes(),
                # The process must not run on the CPU of a pinned core.
                'avoid_cpus': sorted(allowed) if len(allowed) == 1 else [],
                'settings': {**self.settings, 'port': SYNTHETIC if synthetic else port},
            }), self._memory.fd)
        except DeviceError as error:
            self.close()
            raise DeviceError(f'{self.name}: {error}') from error
        except OSError as error:
            self.close()
            raise DeviceError(f'{self.name}: its capture process cannot be started: '
                              f'{error.strerror or error}') from error

    def _start(self, path: str | Path | None) -> socket.socket:
        if path is not None:
            return connect(path)
        connection, self._stop = spawn_worker()
        return connection

    def close(self) -> None:
        """End the process; may be called twice and does not raise."""
        connection, self._connection = self._connection, None
        if connection is not None:
            connection.close()
        stop, self._stop = self._stop, None
        if stop is not None:
            stop()
        memory, self._memory = self._memory, None
        if memory is not None:
            memory.close()
        self._ready = False
        self._lost_before += self._lost
        self._lost = 0

    def fileno(self) -> int | None:
        """Return the file descriptor that becomes readable with each frame."""
        return None if self._connection is None else self._connection.fileno()

    def read(self, now_ns: int) -> int:
        """
        Publish the available frames; does not block, and can be preempted between pieces.

        :raises DeviceError: the process has ended, or reports a problem.
        """
        connection = self._connection
        if connection is None:
            raise DeviceError(f'{self.name} is not open: call open() first')
        samples = 0
        for _ in range(_PACKETS_PER_READ):
            try:
                length = connection.recv_into(self._buffer)
            except BlockingIOError:
                break
            except ConnectionResetError:
                continue  # reported once, before the reason why the process has ended
            except OSError as error:
                raise DeviceError(f'{self.name}: {_ENDED}') from error
            if not length:
                raise DeviceError(f'{self.name}: {_ENDED}')
            samples += self._take(connection, self._view[:length], now_ns)
        return samples

    def _take(self, connection: socket.socket, packet: memoryview, now_ns: int) -> int:
        kind = packet[0]
        if kind == PacketKind.PROBLEM:
            raise DeviceError(f'{self.name}: {bytes(packet[1:]).decode("utf-8", "replace")}')
        if kind == PacketKind.READY:
            self._ready = True
            return 0
        if kind == PacketKind.OBSERVED:
            try:
                self.observe_ended(packets.parse_json(packet), now_ns)
            except ValueError:
                self._rejected += 1
            return 0
        frame = packets.parse_frame(packet)
        memory = self._memory
        if (frame is None or memory is None or frame.slot >= len(memory.slots)
                or frame.first + frame.second > self.slot_bytes()):
            self._rejected += 1
            return 0
        self._last_ns = now_ns
        self._frames += 1
        self._bytes += frame.first + frame.second
        self._lost = frame.dropped + frame.overruns
        samples = self.handle(frame, memory.slots[frame.slot])
        self._samples += samples
        try:
            connection.send(packets.encode_release(frame.slot))
        except BlockingIOError:
            pass  # it reads nothing: its timeout will restart it
        except OSError as error:
            # Its last message may still be readable; if not, the next read reports the end.
            self._rejected += not isinstance(error, (BrokenPipeError, ConnectionError))
        return samples

    def statistics(self) -> DeviceStatistics:
        """Return the current counters; lost samples are frames without a slot, and overruns."""
        return DeviceStatistics(
            bytes_read=self._bytes, frames=self._frames, samples=self._samples,
            rejected_frames=self._rejected, last_frame_ns=self._last_ns,
            lost_samples=self._lost_before + self._lost)
