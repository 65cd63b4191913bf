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
The log file: written by a separate thread, so that a slow or full disk delays no other thread.

Lines that cannot be written are counted, and reported once. When the disk works again, this is
reported too, also in the file.
"""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
import os
from pathlib import Path
import queue
import threading
import time

from rt_robot_os.linux.folders import open_to_append

WAITING_MAXIMUM = 4096
RETRY_S = 5.0
_END_PATIENCE_S = 2.0
_NS_PER_S = 1_000_000_000


def line_of(wall_ns: int, severity: str, source: str, text: str) -> str:
    """Format a report; further lines of its text are indented."""
    seconds, rest_ns = divmod(wall_ns, _NS_PER_S)
    at = datetime.fromtimestamp(seconds).astimezone().replace(microsecond=rest_ns // 1000)
    body = text.rstrip('\n').replace('\n', '\n    ')
    return f'{at.isoformat(timespec="milliseconds")} {severity} {source}: {body}\n'


class LogFile:
    """
    A rotated file: at its maximum size it becomes ``.1``, that one ``.2``; the oldest is deleted.

    :param maximum_bytes: of one file; a longer line gets its own file.
    :param files: maximum number of files.
    :param warn: called, in the writing thread, when the disk fails, and when it works again.
    :param retry_s: pause before the next attempt.
    :ivar lost: lines that were not written, because of the disk or because they came too fast.
    """

    def __init__(self, path: Path, maximum_bytes: int, files: int,
                 warn: Callable[[str], object], retry_s: float = RETRY_S) -> None:
        self.path = path
        self.written = self.lost = 0
        self._maximum_bytes = maximum_bytes
        self._files = files
        self._warn = warn
        self._retry_s = retry_s
        self._overrun = 0
        self._waiting: queue.Queue[str | None] = queue.Queue(WAITING_MAXIMUM)
        self._fd: int | None = None
        self._size = 0
        self._failing_since_s = 0.0
        self._failed = 0
        self._thread = threading.Thread(target=self._run, name='rt_robot_os log', daemon=True)
        self._thread.start()

    def write(self, line: str) -> None:
        """Queue a line; never blocks."""
        try:
            self._waiting.put_nowait(line)
        except queue.Full:
            self._overrun += 1
            self.lost += 1

    def close(self) -> None:
        """Write queued lines and end, for a limited time; may be called twice."""
        try:
            self._waiting.put(None, timeout=_END_PATIENCE_S)
        except queue.Full:
            return  # the disk hangs; the thread ends with the process
        self._thread.join(_END_PATIENCE_S)

    def _run(self) -> None:
        while (line := self._waiting.get()) is not None:
            self._put(line)
        self._close_file()

    def _put(self, line: str) -> None:
        if self._failed and time.monotonic() - self._failing_since_s < self._retry_s:
            self._failed += 1
            self.lost += 1
            return
        overrun, self._overrun = self._overrun, 0
        notes = [(self._failed, 'the disk failed'), (overrun, 'they came too fast')]
        text = ''.join(f'... {count} lines are missing: {why}\n'
                       for count, why in notes if count) + line
        data = text.encode(errors='backslashreplace')
        try:
            self._append(data)
        except OSError as error:
            self._fail(error)
            return
        self.written += 1
        if self._failed:
            self._warn(f'log file {self.path}: written again; {self._failed} lines were lost')
            self._failed = 0

    def _fail(self, error: OSError) -> None:
        if not self._failed:
            self._warn(f'log file {self.path}: {error.strerror or error}; lines are lost '
                       'until it is writable: free space, or set log.folder')
        self._failed += 1
        self.lost += 1
        self._failing_since_s = time.monotonic()
        self._close_file()

    def _append(self, data: bytes) -> None:
        fd = self._fd if self._fd is not None else self._open()
        if self._size and self._size + len(data) > self._maximum_bytes:
            self._close_file()
            self._rotate()
            fd = self._open()
        left = memoryview(data)
        while left:  # a disk that becomes full accepts a part
            left = left[os.write(fd, left):]
        self._size += len(data)

    def _open(self) -> int:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        fd = open_to_append(self.path)
        self._fd = fd
        self._size = os.fstat(fd).st_size
        return fd

    def _rotate(self) -> None:
        def numbered(number: int) -> Path:
            return self.path.with_name(f'{self.path.name}.{number}') if number else self.path

        if self._files == 1:
            self.path.unlink(missing_ok=True)
        for number in range(self._files - 1, 0, -1):
            if numbered(number - 1).exists():
                os.replace(numbered(number - 1), numbered(number))

    def _close_file(self) -> None:
        fd, self._fd = self._fd, None
        if fd is not None:
            os.close(fd)
