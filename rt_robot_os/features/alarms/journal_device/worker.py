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
The process that writes a journal, on a connection that it inherits.

It returns the records of the journal, then writes new records, waits until they are on the disk,
and reports that. It ends when the core closes the connection, and after it has reported the first
error of the disk; the core starts another process then.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
import json
import os
from pathlib import Path
import select
import socket
import sys
import time
from typing import Any
from typing import Final

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.features.alarms.journal_device.folder import JournalFolder
from rt_robot_os.features.alarms.journal_device.protocol import JournalPacket
from rt_robot_os.features.alarms.journal_device.protocol import json_packet
from rt_robot_os.features.alarms.journal_device.protocol import packet
from rt_robot_os.features.alarms.journal_device.protocol import PACKET_BYTES
from rt_robot_os.features.alarms.journal_file import JournalFile
from rt_robot_os.features.alarms.journal_file import JournalHistory
from rt_robot_os.features.alarms.journal_file import read_journal
from rt_robot_os.linux.disk_space import is_full
from rt_robot_os.linux.folders import ros_home
from rt_robot_os.linux.lock_file import holder
from rt_robot_os.linux.lock_file import LockFile
from rt_robot_os.linux.process import run_child
from rt_robot_os.linux.process import use_ordinary_scheduling

LOCK: Final = 'lock'


def folder_of(port: str) -> Path:
    """Return the folder that a setting names: a relative one is in ROS's folder of this user."""
    return ros_home() / Path(port).expanduser()


class JournalWorker:
    """
    A connection and a journal.

    :param connection: to the core; blocks.
    :raises DeviceError: the first packet of the core is not valid.
    """

    def __init__(self, connection: socket.socket) -> None:
        self._connection = connection
        data = connection.recv(PACKET_BYTES)
        if not data:
            raise ConnectionResetError('the core closed the connection')
        if data[0] != JournalPacket.OPEN:
            raise DeviceError('the first packet of the core is not OPEN')
        self._wanted: dict[str, Any] = json.loads(data[1:])

    def run(self) -> None:
        """
        Write until the core closes the connection.

        :raises DeviceError: another process writes this journal.
        :raises OSError: the disk fails.
        """
        use_ordinary_scheduling(self._wanted['avoid_cpus'])
        folder = JournalFolder(folder_of(self._wanted['folder']))
        lock = LockFile(folder.path / LOCK)
        try:
            self._write(self._opened(folder, lock))
        finally:
            lock.release()
            folder.close()

    def _opened(self, folder: JournalFolder, lock: LockFile) -> JournalFile:
        """
        Open the journal and return its records, even when it cannot be written.

        :raises DeviceError: another robot writes it; nothing is returned.
        """
        try:
            if not lock.acquire():
                there = holder(lock.path) or {}
                raise DeviceError(
                    f'{folder.path} is written by process {there.get("pid", "?")}, for '
                    f'{there.get("device", "another robot")}: give each robot a folder of its own')
            with suppress(OSError):  # a full disk: the holder of the lock cannot be written
                lock.note(pid=os.getpid(), device=self._wanted['name'])
            journal = JournalFile(folder, self._wanted['limit_bytes'], time.time_ns)
            found = journal.open()
        except DeviceError:  # those are alarms of another robot
            raise
        except OSError:
            self._give_back(read_journal(folder), 0)
            raise
        self._give_back(found, journal.begun)
        return journal

    def _give_back(self, found: JournalHistory, begun: int) -> None:
        living = found.living()
        for each in living:
            self._connection.send(json_packet(JournalPacket.RECORD, {
                'record': each.record, 'age_ns': max(0, time.time_ns() - each.at_ns)}))
        self._connection.send(json_packet(JournalPacket.RESTORED, {
            'restored': len(living), 'torn_bytes': found.torn_bytes, 'damaged': found.damaged,
            'generation': begun}))

    def _write(self, journal: JournalFile) -> None:
        """Write all pending records, and sync once."""
        poll = select.poll()
        poll.register(self._connection, select.POLLIN)
        while True:
            poll.poll()
            kept = False
            while True:
                try:
                    data = self._connection.recv(PACKET_BYTES, socket.MSG_DONTWAIT)
                except BlockingIOError:
                    break
                if not data:
                    raise ConnectionResetError('the core closed the connection')
                if data[0] == JournalPacket.KEEP:
                    text = data[1:].decode()
                    journal.append(text, int(json.loads(text)['seq']))
                    kept = True
                elif data[0] == JournalPacket.PING:
                    self._connection.send(json_packet(JournalPacket.PONG, _room(journal)))
            if kept:
                self._connection.send(json_packet(
                    JournalPacket.STORED, {'stored': journal.commit()}))


def _room(journal: JournalFile) -> dict[str, Any]:
    """Reserve room for new records, and return how much there is."""
    room = journal.keep_room()
    problem = room.problem
    told = '' if problem is None else problem.strerror or str(problem)
    full = problem is not None and is_full(problem)
    return {'kept_kb': room.kept_bytes // 1024, 'put_off': journal.put_off,
            'full': told if full else '', 'not_kept': '' if full else told}


def main(arguments: Sequence[str]) -> int:
    """Write until the core closes the connection; the argument is its descriptor."""
    connection = socket.socket(fileno=int(arguments[0]))
    try:
        JournalWorker(connection).run()
    except (BrokenPipeError, ConnectionResetError):
        return 0
    except DeviceError as error:
        text = str(error)
    except OSError as error:
        name = f'{error.filename}: ' if error.filename else ''
        text = f'the journal cannot be written: {name}{error.strerror or error}'
    except Exception as error:  # whatever it is, the core has to report it
        text = f'the journal cannot be written: {type(error).__name__}: {error}'
    try:
        connection.send(packet(JournalPacket.FAULT, text))
    except OSError:
        pass  # the core has closed the connection
    return 1


if __name__ == '__main__':
    sys.exit(run_child(main))
