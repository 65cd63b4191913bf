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
Writes records into the database from asyncio: one thread writes the records of all robots.

While a commit waits for the disk the next batches gather and share the next commit: the more
robots, the fewer syncs per record. A batch with an alarm is written before the others. A batch
that cannot be written stays queued and is retried, and nothing is acknowledged until it is on the
disk.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Mapping
from collections.abc import Sequence
import logging
import threading
from typing import Any
from typing import Final

from rt_robot_os.base.errors import StoreError
from rt_robot_os.messages.uplink.importance import Importance
from rt_robot_os.monitor.store.adding import Added
from rt_robot_os.monitor.store.adding import ReceivedBatch
from rt_robot_os.monitor.store.robot_clock import RobotClock
from rt_robot_os.monitor.store.store import Hello
from rt_robot_os.monitor.store.store import Store

_LOG: Final = logging.getLogger(__name__)
#: Approximate number of records of one transaction: it limits how long the next ones wait.
GROUP_RECORDS: Final = 2000
#: Most queued records of all robots; further callers wait for space.
WAITING_RECORDS: Final = 100_000
RETRY_S: Final = 0.5
#: Records that could not be written for this long are refused.
TIMEOUT_S: Final = 30.0
RETRY_MOST_S: Final = 5.0
#: Records that are not urgent wait this long for others to share the commit.
GATHER_S: Final = 0.02


class _Waiting:
    """A batch, and the caller that waits for it."""

    def __init__(self, batch: ReceivedBatch, loop: asyncio.AbstractEventLoop) -> None:
        self.batch = batch
        self.loop = loop
        self.future: asyncio.Future[Added] = loop.create_future()
        self.urgent = any(isinstance(each, Mapping) and each.get('importance') in _URGENT
                          for each in batch.records)

    def done(self, result: Added | BaseException) -> None:
        """Pass the result to the caller, from the writer's thread."""
        try:
            self.loop.call_soon_threadsafe(self._set, result)
        except RuntimeError:
            pass  # Its loop has ended: no caller waits any more.

    def _set(self, result: Added | BaseException) -> None:
        if self.future.done():
            return
        if isinstance(result, BaseException):
            self.future.set_exception(result)
        else:
            self.future.set_result(result)


_URGENT: Final = frozenset({int(Importance.ALARM), int(Importance.EVENT)})


class RecordWriter:
    """
    The writer of records; it starts immediately and is ended by :meth:`close`.

    :ivar waiting: queued records.
    :ivar commits: transactions so far.
    :ivar failures: failed transactions.
    :ivar fault: why nothing can be written now; '' without a fault.
    """

    def __init__(self, store: Store, *, waiting_records: int = WAITING_RECORDS) -> None:
        self._store = store
        self._most = waiting_records
        self.waiting = 0
        self.commits = 0
        self.failures = 0
        self.fault = ''
        self._urgent: deque[_Waiting] = deque()
        self._others: deque[_Waiting] = deque()
        self._hellos: dict[str, Hello] = {}
        self._changed = threading.Condition()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name='writer', daemon=True)
        self._thread.start()

    async def put(self, robot: str, boot: str, records: Sequence[Mapping[str, Any]],
                  timeout_s: float = TIMEOUT_S, clock: RobotClock = RobotClock()) -> Added:
        """
        Write records; when it returns they are on the disk, except for refused ones.

        :param clock: of the robot.
        :return: the result.
        :raises StoreError: for ``timeout_s`` the database was unavailable or full, or the queue
            was full. They may be written later all the same: send them again.
        """
        loop = asyncio.get_running_loop()
        one = _Waiting(ReceivedBatch(robot, boot, records, clock), loop)
        end = loop.time() + timeout_s
        try:
            while not self._enter(one):
                if loop.time() >= end:
                    raise self._late(timeout_s)
                await asyncio.sleep(0.05)
            await asyncio.wait({one.future}, timeout=max(0.0, end - loop.time()))
            if not one.future.done():
                raise self._late(timeout_s)
            return one.future.result()
        finally:
            one.future.cancel()

    def hello(self, hello: Hello) -> None:
        """
        Store the hello of a robot soon; only the newest of each robot.

        Hellos of all robots that connect meanwhile share a commit. They wait while the database is
        unavailable.
        """
        with self._changed:
            self._hellos[hello.robot] = hello
            self._changed.notify()

    def _late(self, timeout_s: float) -> StoreError:
        if timeout_s >= TIMEOUT_S and not self.fault:
            self.fault = f'the database has stored nothing for {timeout_s:g} s'
        return StoreError(f'not written within {timeout_s:g} s: '
                          f'{self.fault or "too many records are queued"}')

    def close(self) -> None:
        """Write the queued records once, and end."""
        with self._changed:
            self._closing.set()
            self._changed.notify()
        self._thread.join()

    def _enter(self, one: _Waiting) -> bool:
        with self._changed:
            if self._closing.is_set():
                raise StoreError('the server is about to end')
            if self.waiting and self.waiting + len(one.batch.records) > self._most and (
                    not one.urgent):
                return False
            (self._urgent if one.urgent else self._others).append(one)
            self.waiting += len(one.batch.records)
            self._changed.notify()
        return True

    # ---- in the thread -----------------------------------------------------------------------

    def _run(self) -> None:
        pause_s = RETRY_S
        while (group := self._next()) is not None:
            try:
                self._write_hellos()
                # An empty group means that no caller waits for an answer any more.
                added = self._store.add_all([each.batch for each in group]) if group else []
            except StoreError as error:
                self.failures += 1
                self.fault = str(error)
                self._back(group)
                if self._closing.wait(pause_s):
                    break
                pause_s = min(2 * pause_s, RETRY_MOST_S)
                continue
            except Exception as error:
                self.failures += 1
                self._one_by_one(group, error)
            else:
                # Cleared before the callers learn that their records are stored.
                self.fault = '' if group else self.fault
                for each, result in zip(group, added, strict=True):
                    each.done(result)
            self.commits += bool(group)
            if group or pause_s > RETRY_S:  # hellos alone clear only their own fault
                self.fault = ''
            pause_s = RETRY_S
        self._turn_away()

    def _next(self) -> list[_Waiting] | None:
        """Return the batches to write together; None at the end."""
        group: list[_Waiting] = []
        count = 0
        with self._changed:
            self._changed.wait_for(lambda: self._urgent or self._others or self._hellos
                                   or self._closing.is_set())
            if not self._urgent and not self._closing.is_set():
                self._changed.wait_for(lambda: self._urgent or self._closing.is_set(), GATHER_S)
            for queue in (self._urgent, self._others):
                while queue and (not group or count + len(queue[0].batch.records)
                                 <= GROUP_RECORDS):
                    one = queue.popleft()
                    self.waiting -= len(one.batch.records)
                    if not one.future.cancelled():
                        group.append(one)
                        count += len(one.batch.records)
            ended = self._closing.is_set() and not (
                group or self._urgent or self._others or self._hellos)
        return None if ended else group

    def _write_hellos(self) -> None:
        with self._changed:
            hellos, self._hellos = self._hellos, {}
        if not hellos:
            return
        try:
            self._store.hello_all(list(hellos.values()))
        except StoreError:
            with self._changed:
                self._hellos = {**hellos, **self._hellos}  # those of meanwhile are newer
            raise
        except Exception:
            for each in hellos.values():
                self._write_hello(each)

    def _write_hello(self, hello: Hello) -> None:
        """Write one hello of several that failed together, so that only the faulty one is lost."""
        try:
            self._store.hello_all([hello])
        except Exception as error:
            self.failures += 1
            _LOG.error('the hello of the robot %s cannot be stored: %s', hello.robot, error)

    def _back(self, group: Sequence[_Waiting]) -> None:
        with self._changed:
            for one in reversed(group):
                if not one.future.cancelled():
                    (self._urgent if one.urgent else self._others).appendleft(one)
                    self.waiting += len(one.batch.records)

    def _one_by_one(self, group: Sequence[_Waiting], error: Exception) -> None:
        """Find the faulty batch, so that only this one is refused."""
        if len(group) == 1:
            group[0].done(StoreError(f'refused: {type(error).__name__}: {str(error)[:200]}'))
            return
        for one in group:
            try:
                one.done(self._store.add_all([one.batch])[0])
            except Exception as own:
                one.done(StoreError(f'refused: {type(own).__name__}: {str(own)[:200]}'))

    def _turn_away(self) -> None:
        with self._changed:
            left = [*self._urgent, *self._others]
            self._urgent.clear()
            self._others.clear()
            self.waiting = 0
        for one in left:
            one.done(StoreError('the server has ended before it was written'))
