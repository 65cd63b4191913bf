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
Cached answers of the database, for the time in which it is unavailable.

A stop, an acknowledgement, live data and a connecting robot need authentication. The answer comes
from the database while it responds promptly, otherwise from the cache, for at most
:data:`OUTAGE_S`.
"""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures import ThreadPoolExecutor
import threading
import time
from typing import Any
from typing import Final
from typing import Generic
from typing import TypeVar

from rt_robot_os.base.errors import StoreError

#: How long an answer is valid while the database is unavailable; no session lasts longer.
OUTAGE_S: Final = 12 * 3600.0
#: A database that does not answer within this time counts as unavailable.
PATIENCE_S: Final = 1.0
#: How long a client that is not in the cache waits for the database.
UNKNOWN_S: Final = 10.0
_THREADS: Final = 4
_QUESTIONS_MOST: Final = 64
_ENTRIES_MOST: Final = 20_000

_T = TypeVar('_T')


class Memory(Generic[_T]):
    """
    Answers of the database by their keys, each valid for a time; safe for threads.

    :param lasts_s: validity of an answer.
    :param clock_s: the clock in s; replaced in tests.
    """

    def __init__(self, lasts_s: float = OUTAGE_S, most: int = _ENTRIES_MOST,
                 clock_s: Callable[[], float] = time.monotonic) -> None:
        self._lasts_s = lasts_s
        self._most = most
        self._clock_s = clock_s
        self._lock = threading.Lock()
        self._entries: OrderedDict[str, tuple[float, _T]] = OrderedDict()

    def store(self, key: str, value: _T) -> None:
        """Store an answer of the database; the oldest entry is evicted."""
        with self._lock:
            self._entries[key] = self._clock_s(), value
            self._entries.move_to_end(key)
            if len(self._entries) > self._most:
                self._entries.popitem(last=False)

    def find(self, key: str) -> _T | None:
        """Return a value that is still valid."""
        with self._lock:
            stored_s, value = self._entries.get(key, (0.0, None))
            return value if self._clock_s() - stored_s <= self._lasts_s else None

    def forget(self, is_meant: Callable[[str, _T], bool]) -> None:
        """Remove the entries for which a function of key and value returns true."""
        with self._lock:
            for key in [key for key, (_, value) in self._entries.items() if is_meant(key, value)]:
                del self._entries[key]


class Questions:
    """
    Queries of the database in separate threads; use it from an event loop.

    Other threads of the server that wait for the database cause no delay here. While a query waits
    for longer than :data:`PATIENCE_S` the next ones are answered from memory immediately.
    """

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(_THREADS, 'questions')
        self._asked_s: dict[Future[Any], float] = {}

    async def ask(self, question: Callable[[], _T], remembered: Callable[[], _T | None]
                  ) -> _T:
        """
        Query the database, or else the memory.

        :param question: may block; it raises StoreError while the database is away.
        :param remembered: returns None when there is nothing in memory; it does not block.
        :raises StoreError: the database is unavailable, and memory has no answer.
        """
        if self._is_hung() and (known := remembered()) is not None:
            return known
        future = asyncio.wrap_future(self._submit(question))
        future.add_done_callback(_retrieved)
        for patience_s in (PATIENCE_S, UNKNOWN_S):
            await asyncio.wait({future}, timeout=patience_s)
            if future.done():
                break
            if (known := remembered()) is not None:
                return known
        try:
            if future.done():
                return future.result()
            raise StoreError(f'the database has not answered for {UNKNOWN_S:g} s')
        except StoreError:
            if (known := remembered()) is not None:
                return known
            raise

    def close(self) -> None:
        """End the threads; later queries are refused."""
        self._pool.shutdown(wait=False, cancel_futures=True)

    def _is_hung(self) -> bool:
        oldest_s = min(list(self._asked_s.values()), default=None)
        return oldest_s is not None and time.monotonic() - oldest_s > PATIENCE_S

    def _submit(self, question: Callable[[], _T]) -> Future[_T]:
        if len(self._asked_s) >= _QUESTIONS_MOST:
            raise StoreError(f'{_QUESTIONS_MOST} queries wait for the database')
        try:
            future = self._pool.submit(question)
        except RuntimeError as error:
            raise StoreError('the server is about to end') from error
        self._asked_s[future] = time.monotonic()
        future.add_done_callback(lambda done: self._asked_s.pop(done, None))
        return future


def _retrieved(future: asyncio.Future[_T]) -> None:
    """Retrieve an error that arrives when no caller waits for it any more."""
    if not future.cancelled():
        future.exception()
