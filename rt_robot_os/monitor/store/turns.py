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
A fair lock: the writers of one process take turns, in the order in which they asked.

Waiting connections of SQLite poll, and an unlucky one fails in the end (``database is locked``).
With turns this happens only between processes.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
import threading
from typing import Final

from rt_robot_os.base.errors import StoreError

#: A writer gives up after this time: the database does not answer the current writer.
TURN_S: Final = 30.0


class Turns:
    """The turns of one database; thread-safe. A thread must not hold two at a time."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._waiting: deque[threading.Event] = deque()
        self._is_taken = False

    @contextmanager
    def turn(self, timeout_s: float = TURN_S) -> Iterator[None]:
        """
        Wait for a turn, and hold it to the end of the block.

        :raises StoreError: the turn did not come in time.
        """
        mine = threading.Event()
        with self._lock:
            if self._is_taken:
                self._waiting.append(mine)
            else:
                self._is_taken = True
                mine.set()
        if not mine.wait(timeout_s):
            self._give_up(mine, timeout_s)
        try:
            yield
        finally:
            with self._lock:
                if self._waiting:
                    self._waiting.popleft().set()
                else:
                    self._is_taken = False

    def _give_up(self, mine: threading.Event, timeout_s: float) -> None:
        with self._lock:
            if not mine.is_set():  # otherwise it came at the last moment
                self._waiting.remove(mine)
                raise StoreError(f'database: other threads have been writing for {timeout_s:g} s')
