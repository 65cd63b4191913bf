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
The capture process of one device, on an inherited connection.

It has ordinary priority and does not run on the CPU of a pinned core. It ends when the core closes
the connection, also while a library hangs: a separate thread waits for that.
"""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Sequence
import os
import select
import socket
import sys
import threading
import time
from typing import Any
from typing import Protocol

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.devices.capture import packets
from rt_robot_os.devices.capture.packets import CapturedFrame
from rt_robot_os.devices.capture.packets import PacketKind
from rt_robot_os.devices.capture.scene_memory import SceneMemory
from rt_robot_os.linux.memory_file import FD_BYTES
from rt_robot_os.linux.memory_file import Loans
from rt_robot_os.linux.memory_file import MemoryFile
from rt_robot_os.linux.memory_file import received_fds
from rt_robot_os.linux.process import run_child
from rt_robot_os.linux.process import use_ordinary_scheduling


class Captured(Protocol):
    """One image or block of sound that is not in a slot yet."""

    @property
    def stamp_ns(self) -> int:
        """Return the time of its capture on CLOCK_MONOTONIC."""

    @property
    def seq(self) -> int:
        """Return its number."""

    def store(self, slot: memoryview) -> tuple[int, int]:
        """
        Write it into a slot, compressed if configured.

        :return: bytes of the first part and of the second.
        """

    def levels(self) -> tuple[float, float]:
        """Return the level and the peak of sound, in dB below full scale."""


class FrameSource(Protocol):
    """A source of frames."""

    @property
    def overruns(self) -> int:
        """Return the number of losses in the source."""

    def frames(self) -> Iterator[Captured]:
        """
        Yield frame after frame; blocks until each.

        :raises DeviceError: it is gone, at its end, or sends invalid data.
        """

    def close(self) -> None:
        """Close it."""


class ObservationStore(Protocol):
    """Stores pictures in files."""

    def add(self, seen: Any) -> None:
        """Add a picture."""

    def request(self, request: dict[str, Any], now_ns: int) -> None:
        """Execute a request."""

    def close(self) -> None:
        """Finish the started files, and end."""


def observation_store(kind: str, settings: dict[str, Any], source: Any,
                      answer: Any) -> ObservationStore | None:
    """Return the store of a camera with observations; otherwise None."""
    if kind != 'camera' or not settings.get('observe_topic'):
        return None
    from rt_robot_os.devices.capture.observations import Observations
    return Observations(settings, source, answer)


def frame_source(kind: str, settings: dict[str, Any],
                 scene: SceneMemory | None = None) -> FrameSource:
    """
    Open the source of the settings.

    :param scene: the scene of a simulated device.
    :raises DeviceError: it cannot be opened, or a library is missing.
    """
    # Imports are local: OpenCV alone takes a third of a second.
    if kind == 'camera':
        from rt_robot_os.devices.capture.camera import open_camera
        return open_camera(settings, scene)
    if kind == 'sound':
        from rt_robot_os.devices.capture.sound import open_sound
        return open_sound(settings, scene)
    raise DeviceError(f'unknown kind of source {kind!r}')


class CaptureWorker:
    """
    A capture process: a connection, the memory received with it, and a source.

    :param connection: to the core.
    :param scene: the scene of a simulated device.
    """

    def __init__(self, connection: socket.socket, scene: SceneMemory | None = None) -> None:
        self._connection = connection
        self._scene = scene
        buffer = bytearray(packets.PACKET_BYTES_MAXIMUM)
        length, ancillary, _, _ = connection.recvmsg_into([buffer], FD_BYTES,
                                                          socket.MSG_CMSG_CLOEXEC)
        fds = received_fds(ancillary)
        if not length or buffer[0] != PacketKind.OPEN or len(fds) != 1:
            raise DeviceError('the core sent another packet than OPEN')
        try:
            self.wanted = packets.parse_json(memoryview(buffer)[:length])
        except ValueError as error:
            raise DeviceError(f'the core and its capture process do not match: {error}; restart '
                              'the robot') from error
        self._memory = MemoryFile.received(fds[0], self.wanted['slots'],
                                           self.wanted['slot_bytes'])
        self._loans = Loans(self.wanted['slots'])
        self._store: ObservationStore | None = None
        self.dropped = 0

    def place(self) -> None:
        """Set ordinary priority, and avoid the CPU of a pinned core."""
        use_ordinary_scheduling(self.wanted['avoid_cpus'])

    def run(self) -> None:
        """
        Capture until the core closes the connection.

        :raises DeviceError: the source fails.
        """
        kind, settings = self.wanted['source'], self.wanted['settings']
        source = frame_source(kind, settings, self._scene)
        self._store = observation_store(kind, settings, source, self._tell)
        try:
            self._connection.send(packets.encode_json(PacketKind.READY, {}))
            for captured in source.frames():
                self._take_back()
                self._hand_over(captured, source.overruns)
                if self._store is not None:
                    self._store.add(captured)
        finally:
            if self._store is not None:
                self._store.close()
            source.close()

    def _tell(self, observed: dict[str, Any]) -> None:
        """Send the result of a request; any thread may call this."""
        try:
            self._connection.send(packets.encode_json(PacketKind.OBSERVED, observed))
        except OSError:
            pass  # the main thread detects it

    def _hand_over(self, captured: Captured, overruns: int) -> None:
        slot = self._loans.acquire()
        if slot < 0:
            self.dropped += 1
            return
        first, second = captured.store(self._memory.slots[slot])
        rms_db, peak_db = captured.levels()
        self._loans.lend(slot)
        try:
            self._connection.send(CapturedFrame(
                slot, captured.stamp_ns, captured.seq, first, second, self.dropped, overruns,
                rms_db, peak_db).encode(), socket.MSG_DONTWAIT)
        except BlockingIOError:
            self._loans.put_back(slot)
            self.dropped += 1

    def _take_back(self) -> None:
        while True:
            try:
                packet = self._connection.recv(packets.PACKET_BYTES_MAXIMUM, socket.MSG_DONTWAIT)
            except BlockingIOError:
                return
            if not packet:
                raise ConnectionResetError('the core closed the connection')
            if packet[0] == PacketKind.REQUEST and self._store is not None:
                self._store.request(packets.parse_json(packet), time.monotonic_ns())
                continue
            slot = packets.parse_release(packet)
            if slot is not None:
                self._loans.returned(slot)


def _end_with(connection: socket.socket) -> None:
    """End the process when the other side closes, even if the main thread hangs."""
    poll = select.poll()
    poll.register(connection, select.POLLRDHUP)
    poll.poll()
    os._exit(0)


def main(arguments: Sequence[str]) -> int:
    """
    Capture until the core closes the connection.

    :param arguments: its descriptor; for a simulated device in a world also that of its scene.
    """
    connection = socket.socket(fileno=int(arguments[0]))
    scene = SceneMemory(int(arguments[1])) if len(arguments) > 1 else None
    threading.Thread(target=_end_with, args=(connection,), daemon=True).start()
    try:
        worker = CaptureWorker(connection, scene)
        worker.place()
        worker.run()
    except DeviceError as error:
        text = str(error)
    except (BrokenPipeError, ConnectionResetError):
        return 0
    except Exception as error:  # an error of a library, for the report of the core
        text = f'capturing failed: {type(error).__name__}: {error}'
    else:
        text = 'its source ended'
    try:
        connection.send(packets.problem(text))
    except OSError:
        pass  # the connection is closed
    return 1


if __name__ == '__main__':
    sys.exit(run_child(main))
