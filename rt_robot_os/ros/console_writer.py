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
Write log lines to the console and to /rosout in a separate thread.

If the console is not read (Ctrl-S, a full pipe), only this thread blocks. Lines that it cannot
keep up with are dropped, counted and reported.
"""

from __future__ import annotations

from collections.abc import Callable
import queue
import threading
import time
from typing import NamedTuple

WAITING_MAXIMUM = 1000
# More lines would not be read, and would cost computing time that mirrors need.
LINES_A_SECOND = 500
_BURST = 1000
_END_PATIENCE_S = 1.0


class ConsoleLine(NamedTuple):
    """
    A line to write.

    :ivar wall_ns: when it was logged; 0 for a line of the node itself.
    :ivar source: part of the core; empty for the node itself.
    """

    severity: int
    wall_ns: int
    source: str
    text: str


class ConsoleWriter:
    """
    Write lines in order.

    :param write: writes a line, in the thread; may block.
    :param summary: makes a line with the number of dropped lines.
    :ivar untold: lines that were dropped, because they came too fast or were not read.
    """

    def __init__(self, write: Callable[[ConsoleLine], object],
                 summary: Callable[[int], ConsoleLine]) -> None:
        self.untold = 0
        self._write = write
        self._summary = summary
        self._missing = 0
        self._left = float(_BURST)
        self._earned_s = time.monotonic()
        self._waiting: queue.Queue[ConsoleLine | None] = queue.Queue(WAITING_MAXIMUM)
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._run, name='rt_robot_os tell', daemon=True)
        self._thread.start()

    def put(self, line: ConsoleLine) -> None:
        """Queue a line; never blocks, thread-safe."""
        with self._lock:
            if self._affordable():
                try:
                    self._waiting.put_nowait(line)
                    return
                except queue.Full:
                    pass
            self.untold += 1
            self._missing += 1

    def close(self) -> bool:
        """
        Write queued lines, for a limited time; may be called twice.

        :return: False if the thread is still blocked by the console.
        """
        deadline_s = time.monotonic() + _END_PATIENCE_S
        try:
            self._waiting.put(None, timeout=_END_PATIENCE_S)
        except queue.Full:
            return False
        self._thread.join(max(0.0, deadline_s - time.monotonic()))
        return not self._thread.is_alive()

    def _affordable(self) -> bool:
        now_s = time.monotonic()
        self._left = min(_BURST, self._left + (now_s - self._earned_s) * LINES_A_SECOND)
        self._earned_s = now_s
        if self._left < 1:
            return False
        self._left -= 1
        return True

    def _run(self) -> None:
        while (line := self._waiting.get()) is not None:
            with self._lock:
                missing, self._missing = self._missing, 0
            if missing:
                self._write(self._summary(missing))
            self._write(line)
