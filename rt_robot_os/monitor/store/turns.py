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
Writers of one process take turns, in the order in which they came.

SQLite lets those who wait poll, and turns away who has had bad luck for long enough (``database is
locked``). With turns that is left to other processes.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
import threading
from typing import Final

from rt_robot_os.base.errors import StoreError

#: Who has waited for so long gives up: the database does not answer who is writing now.
TURN_S: Final = 30.0


class Turns:
    """The turns at one database; safe for threads. A thread must not take two at a time."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._waiting: deque[threading.Event] = deque()
        self._is_taken = False

    @contextmanager
    def turn(self, timeout_s: float = TURN_S) -> Iterator[None]:
        """
        Wait for a turn, and have it to the end of the block.

        :raises StoreError: it did not come in time.
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
            if not mine.is_set():  # else it came at the last moment
                self._waiting.remove(mine)
                raise StoreError(f'database: others have been writing for {timeout_s:g} s')
