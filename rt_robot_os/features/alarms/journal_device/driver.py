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
The journal of alarms: the core's side, a device whose port is a process that writes.

It sends records to the process and publishes its replies: the records of before a restart, up to
which record all are on the disk, and faults. Module ``alarms`` keeps the records that are not
stored yet, and sends them again when the journal was opened again. In a replay the process is not
started: its replies are in the recording.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
import json
import os
import socket
from typing import Any
from typing import ClassVar
from typing import Final

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.capture.device import connect
from rt_robot_os.devices.capture.device import is_socket
from rt_robot_os.devices.capture.spawn import spawn_worker
from rt_robot_os.devices.device import Device
from rt_robot_os.devices.device import DeviceStatistics
from rt_robot_os.features.alarms.journal_device.protocol import JournalPacket
from rt_robot_os.features.alarms.journal_device.protocol import json_packet
from rt_robot_os.features.alarms.journal_device.protocol import packet
from rt_robot_os.features.alarms.journal_device.protocol import PACKET_BYTES
from rt_robot_os.features.alarms.journal_device.service import WORKER
from rt_robot_os.messages.cause import CAUSES_MESSAGE
from rt_robot_os.topics.ports import Input
from rt_robot_os.topics.ports import Output

_PACKETS_PER_READ: Final = 8
_PING_NS: Final = NS_PER_S
# A disk that stays full is reported again, in case that alarm was resolved.
_AGAIN_NS: Final = 60 * NS_PER_S
_KB: Final = 1024
_LOW: Final = ('{}: alarms are stored in the {} KiB that were kept free for them, and not at all '
               'when that is used up; make room on the disk')
_ENDED: Final = ('its process ended without a message (it was killed, or the memory was full); '
                 'it is started again')


class Journal(Device):
    """The journal of alarms."""

    SETTINGS = (
        Field('port', str, 'alarms', 'Folder of the journal; a relative one is in $ROS_HOME or '
              '~/.ros. sim is a folder that is empty at each start.'),
        Field('limit_kb', int, 1024, 'A file of this length is rewritten, without the oldest '
              'ended alarms.', 'KiB', 64, 65_536),
    )
    description = 'journal of alarms on the disk, which survives a crash and a power failure'
    SERVICES = ('journals',)
    ANSWERS = True
    OPENING_S: ClassVar[float] = 10.0
    IF_SILENT = 'its process hangs: look whether the disk does'
    records = Input('alarms/journal', wake=True, message=CAUSES_MESSAGE)
    stored = Output('alarms/stored', CAUSES_MESSAGE, tail=PACKET_BYTES, depth=32, most_hz=5.0)

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """Store the settings; nothing is opened."""
        super().__init__(name, settings)
        self._connection: socket.socket | None = None
        self._stop: Callable[[], object] | None = None
        self._ready = False
        self._pinged_ns = self._stamp_ns = 0
        self._lost = 0
        self._bytes = self._frames = self._samples = self._rejected = self._last_ns = 0
        self._told: dict[str, int] = {'records': 0, 'records_not_ready': 0, 'resends': 0,
                                      'kept_kb': 0, 'put_off': 0}
        self._found = self._low = self._not_kept = ''
        self._low_told: bool | None = None
        self._low_ns = 0

    def open(self) -> None:  # noqa: A003
        """
        Start a process that reads the journal; its records arrive later, with :meth:`read`.

        :raises DeviceError: the process cannot be started.
        """
        self.close()
        port = self.settings['port']
        synthetic = is_socket(port)
        try:
            path = port if synthetic else self.services.get('journals')
            if path is not None:
                self._connection = connect(path)
            else:
                self._connection, self._stop = spawn_worker(WORKER)
            allowed = os.sched_getaffinity(0)
            self._connection.send(json_packet(JournalPacket.OPEN, {
                'name': self.name, 'folder': f'{port}.files' if synthetic else port,
                'limit_bytes': self.settings['limit_kb'] * _KB,
                # A core that is pinned wants its CPU for itself.
                'avoid_cpus': sorted(allowed) if len(allowed) == 1 else []}))
        except DeviceError as error:
            self.close()
            raise DeviceError(f'{self.name}: {error}') from error
        except OSError as error:
            self.close()
            raise DeviceError(f'{self.name}: no process can be started to write the journal: '
                              f'{error.strerror or error}') from error
        self._pinged_ns = 0

    def close(self) -> None:
        """End the process; may be called twice and does not raise."""
        connection, self._connection = self._connection, None
        if connection is not None:
            connection.close()
        stop, self._stop = self._stop, None
        if stop is not None:
            stop()
        self._ready = False

    def fileno(self) -> int | None:
        """Return the file descriptor of the replies of the process."""
        return None if self._connection is None else self._connection.fileno()

    def quiet_s(self) -> float:
        """Return how long a disk may take to write."""
        return self.OPENING_S

    def receive(self, now_ns: int, polled: bool) -> int:
        """
        Send records that are to be stored, if the journal is ready.

        :raises DeviceError: the process has ended, or receives nothing more.
        """
        while self.records.take():
            if not self._ready:
                self._told['records_not_ready'] += 1  # sent again when it is
            elif self.records.lost == self._lost:
                self._told['records'] += 1
                self._send(packet(JournalPacket.KEEP, str(self.records.msg.data)))
        if self.records.lost != self._lost:
            self._lost = self.records.lost
            self._told['resends'] += 1
            if self._ready:
                self._publish('{"resend":true}', now_ns)
        return 0

    def write(self, now_ns: int) -> None:
        """Check now and then whether the process responds."""
        if now_ns - self._pinged_ns >= _PING_NS:
            self._pinged_ns = now_ns
            self._send(packet(JournalPacket.PING))

    def read(self, now_ns: int) -> int:
        """
        Publish the replies of the process; does not block.

        :raises DeviceError: the process has ended, or reports a fault.
        """
        connection = self._connection
        if connection is None:
            raise DeviceError(f'{self.name}: it is not open: call open() first')
        samples = 0
        for _ in range(_PACKETS_PER_READ):
            try:
                data = connection.recv(PACKET_BYTES)
            except BlockingIOError:
                break
            except ConnectionResetError:  # it ended with packets unread; its last words follow
                continue
            except OSError:
                data = b''
            if not data:
                self._fail(_ENDED, now_ns)
            samples += self._take(data, now_ns)
        self._samples += samples
        return samples

    def _take(self, data: bytes, now_ns: int) -> int:
        kind, text = data[0], data[1:].decode('utf-8', 'replace')
        self._bytes += len(data)
        self._last_ns = now_ns
        self._frames += 1
        if kind == JournalPacket.FAULT:
            self._fail(text, now_ns)
        if kind == JournalPacket.PONG:
            return self._take_room(text, now_ns)
        if kind not in (JournalPacket.RECORD, JournalPacket.RESTORED, JournalPacket.STORED):
            self._rejected += 1
            return 0
        if kind == JournalPacket.RESTORED:
            try:
                found = json.loads(text)
                self._look_at(int(found['torn_bytes']), int(found['damaged']))
            except (ValueError, KeyError, TypeError):
                self._rejected += 1
                return 0
            self._ready = True
        self._publish(text, now_ns)
        return 1

    def _take_room(self, text: str, now_ns: int) -> int:
        """Update the reserve on the disk; report a full disk before the reserve is used up."""
        try:
            found = json.loads(text)
            kept_kb, put_off = int(found['kept_kb']), int(found['put_off'])
            full, not_kept = str(found['full']), str(found['not_kept'])
        except (ValueError, KeyError, TypeError):
            self._rejected += 1
            return 0
        self._told['kept_kb'], self._told['put_off'] = kept_kb, put_off
        if not_kept and not self._not_kept:
            self.log.warn('no room can be kept for the journal (%s): when the disk is full, '
                          'notifications are sent without being stored', not_kept)
        self._not_kept = not_kept
        self._low = _LOW.format(full, kept_kb) if full else ''
        if bool(full) != self._low_told or (full and now_ns - self._low_ns >= _AGAIN_NS):
            self._low_told, self._low_ns = bool(full), now_ns
            self._publish(json.dumps({'low': self._low}), now_ns)
        return 1

    def _look_at(self, torn_bytes: int, damaged: int) -> None:
        """Log what a crash has left behind."""
        if torn_bytes:
            self.log.info('%d bytes at the end had not been finished, and are left out',
                          torn_bytes)
        if damaged:
            self._found = (f'the journal was damaged in {damaged} places; what could be read was '
                           'kept: look after the disk')
            self.log.error('%s', self._found)

    def _fail(self, text: str, now_ns: int) -> None:
        self._publish(json.dumps({'fault': text}), now_ns)
        raise DeviceError(f'{self.name}: {text}')

    def _publish(self, text: str, now_ns: int) -> None:
        # Each stamp behind the one before, as recordings keep them.
        self._stamp_ns = max(now_ns, self._stamp_ns + 1)
        self.stored.msg.data = text
        self.stored.publish(self._stamp_ns)

    def _send(self, data: bytes) -> None:
        if self._connection is None:
            return
        try:
            self._connection.send(data)
        except BlockingIOError as error:
            raise DeviceError(f'{self.name}: its process takes nothing more: {self.IF_SILENT}'
                              ) from error
        except OSError:
            pass  # it has ended: what it said last may still be there to read

    def statistics(self) -> DeviceStatistics:
        """Return the present counters."""
        return DeviceStatistics(
            bytes_read=self._bytes, frames=self._frames, samples=self._samples,
            rejected_frames=self._rejected, last_frame_ns=self._last_ns,
            more={**self._told, 'warning': '; '.join(filter(None, (self._found, self._low)))})
