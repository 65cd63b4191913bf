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
The audit: who did and saw what, as a chain that reveals each change.

Each row carries an HMAC over itself and over the HMAC of the row before. An attacker who can write
into the database but does not have the key cannot change, remove, insert or swap a row without
detection by :meth:`Audit.verify`. The head, also sealed with the key, states the length of the
chain.
"""

from __future__ import annotations

from collections import deque
from collections import OrderedDict
from collections.abc import Callable
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
import hashlib
import hmac
import json
import logging
import threading
import time
from typing import Any
from typing import Final
from typing import Protocol

from rt_robot_os.base.errors import StoreError
from rt_robot_os.base.safe_text import safe_text
from rt_robot_os.monitor.security.tables import audit
from rt_robot_os.monitor.security.tables import audit_head
from rt_robot_os.monitor.store.engine import reading
from rt_robot_os.monitor.store.engine import writing
from sqlalchemy import Engine
from sqlalchemy import Row
from sqlalchemy import select

_LOG: Final = logging.getLogger(__name__)
_FIRST: Final = '0' * 64
_HEAD: Final = 1
_PAGE: Final = 1000
#: Most rows that could not be written and wait for the disk.
_WAITING: Final = 10_000
#: Time after a failure until the next attempt to write.
_RETRY_S: Final = 1.0
#: Repeated reading of the same object within this time leaves one row.
READ_AGAIN_S: Final = 600
_READS: Final = 10_000
_COLUMNS: Final = ('seq', 't_ns', 'actor', 'name', 'role', 'address', 'action', 'object',
                   'details', 'previous')


class Subject(Protocol):
    """The actor of a row, such as :class:`~rt_robot_os.monitor.security.guard.Actor`."""

    @property
    def id(self) -> str:  # noqa: A003
        """Return the id of the account."""

    @property
    def name(self) -> str:
        """Return its name."""

    @property
    def role(self) -> str:
        """Return its role."""

    @property
    def address(self) -> str:
        """Return its network address."""


@dataclass(frozen=True)
class Somebody:
    """An actor without a session: at the console, or during a login."""

    name: str
    address: str = ''
    id: str = ''  # noqa: A003
    role: str = ''


CONSOLE: Final = Somebody('console', 'console')


@dataclass(frozen=True)
class ChainVerdict:
    """
    The result of a check of the chain.

    :ivar rows: number of rows read.
    :ivar head: the last number and its HMAC, to be noted elsewhere.
    :ivar problems: one line each; empty when the chain is intact.
    """

    rows: int
    head: str
    problems: tuple[str, ...]

    @property
    def is_whole(self) -> bool:
        """Return whether the chain is intact."""
        return not self.problems


class Audit:
    """The audit; safe for threads and processes."""

    def __init__(self, engine: Engine, key: bytes,
                 now_ns: Callable[[], int] = time.time_ns) -> None:
        """
        Make it.

        :param key: of the HMAC, from a file next to the database.
        """
        self._engine = engine
        self._key = key
        self._now_ns = now_ns
        self._lock = threading.Lock()
        self._memory_lock = threading.Lock()  # never held while waiting for the disk
        self._waiting: deque[dict[str, Any]] = deque()
        self._reads: OrderedDict[tuple[str, str, str], int] = OrderedDict()
        # One thread, so that rows are in the order of the events.
        self._writer = ThreadPoolExecutor(1, 'audit')
        self._submitted = 0
        self._retry_s = 0.0
        #: Rows that were lost because they could not be written for too long.
        self.lost = 0

    @property
    def waiting(self) -> int:
        """Return how many rows wait for the disk."""
        return len(self._waiting) + self._submitted

    def note(self, actor: Subject, action: str, object: str,  # noqa: A002
             **details: Any) -> None:
        """
        Write a row; it is on the disk when this returns.

        When the database accepts no rows, the row is queued, written before the next one, and
        logged: stopping a robot or acknowledging an alarm does not wait for the disk.

        :param action: such as ``alarm.acknowledge``.
        :param object: the object of the action.
        """
        self._put(_row(self._now_ns(), actor, action, object, details), False)

    def note_soon(self, actor: Subject, action: str, object: str,  # noqa: A002
                  **details: Any) -> None:
        """Write a row like :meth:`note`, after earlier ones, without waiting for it."""
        self._put_soon(_row(self._now_ns(), actor, action, object, details))

    def _put_soon(self, row: dict[str, Any]) -> None:
        if self._submitted >= _WAITING:  # the database neither accepts rows nor refuses them
            self.lost += 1
            _LOG.error('the audit cannot be written: %s', json.dumps(row))
            return
        self._count_submitted(1)
        try:
            self._writer.submit(self._put, row, False, True).add_done_callback(
                lambda _: self._count_submitted(-1))
        except RuntimeError:  # closed: this connection ended after the server
            self._count_submitted(-1)
            self._put(row, False)

    def _count_submitted(self, by: int) -> None:
        with self._memory_lock:
            self._submitted += by

    def save_waiting(self) -> None:
        """
        Write the queued rows.

        :raises StoreError: the database is still unavailable.
        """
        with self._lock:
            self._write_waiting()

    def pseudonym(self, text: str) -> str:
        """Return a keyed digest of a string: comparing it needs the key and the string."""
        return hmac.new(self._key, text.encode(), hashlib.sha256).hexdigest()[:32]

    def close(self) -> None:
        """Wait until all rows are written."""
        self._writer.shutdown()

    def read(self, actor: Subject, action: str, object: str,  # noqa: A002
             **details: Any) -> None:
        """
        Write that the actor read health data; one row per object within ten minutes.

        :raises StoreError: the row cannot be written; then the data must not be read.
        """
        self._once(actor, action, object, details, lambda row: self._put(row, True))

    def open(self, actor: Subject, what: str, **details: Any) -> None:  # noqa: A003
        """
        Write that the actor opened a connection for live data, once in ten minutes.

        It does not wait for the disk: safe on an event loop.
        """
        self._once(actor, 'socket.open', what, details, self._put_soon)

    def _once(self, actor: Subject, action: str, object: str,  # noqa: A002
              details: dict[str, Any], put: Callable[[dict[str, Any]], None]) -> None:
        now = time.monotonic_ns()
        key = (getattr(actor, 'session', '') or actor.id, action, object)
        with self._memory_lock:
            last = self._reads.get(key)
            if last is not None and now - last < READ_AGAIN_S * 1_000_000_000:
                return
        put(_row(self._now_ns(), actor, action, object, details))
        with self._memory_lock:
            self._reads[key] = now
            self._reads.move_to_end(key)
            while len(self._reads) > _READS:
                self._reads.popitem(last=False)

    def _put(self, row: dict[str, Any], is_strict: bool, is_soon: bool = False) -> None:
        with self._lock:
            error: object = 'as before'
            if not is_soon or time.monotonic() >= self._retry_s:
                try:
                    self._write_waiting()
                    self._write(row)
                    return
                except StoreError as failure:
                    if is_strict:
                        raise
                    error = failure
                    self._retry_s = time.monotonic() + _RETRY_S
            _LOG.error('the audit cannot be written (%s): %s', error, json.dumps(row))
            if len(self._waiting) >= _WAITING:
                self.lost += 1
            else:
                self._waiting.append(row)

    def _write_waiting(self) -> None:
        while self._waiting:
            self._write(self._waiting[0])
            self._waiting.popleft()

    def _write(self, row: dict[str, Any]) -> None:
        with writing(self._engine) as connection:
            head = connection.execute(select(audit_head).where(audit_head.c.id == _HEAD)).one()
            seq = head.seq + 1
            full = {'seq': seq, **row, 'previous': head.mac or _FIRST}
            mac = self._mac([full[name] for name in _COLUMNS])
            connection.execute(audit.insert().values(mac=mac, **full))
            connection.execute(audit_head.update().where(audit_head.c.id == _HEAD)
                               .values(seq=seq, mac=mac, seal=self._seal(seq, mac)))

    def rows(self, after: int = 0, limit: int = _PAGE, *, newest_first: bool = False,
             name: str = '', action: str = '', before: int | None = None) -> list[dict[str, Any]]:
        """
        Read rows.

        :param after: only rows with a greater number; ``before``: with a smaller one.
        :param name: only rows of this actor.
        :param action: only rows whose action has this prefix.
        """
        query = select(audit).where(audit.c.seq > after)
        if before is not None:
            query = query.where(audit.c.seq < before)
        if name:
            query = query.where(audit.c.name == name)
        if action:
            query = query.where(audit.c.action.startswith(action, autoescape=True))
        order = audit.c.seq.desc() if newest_first else audit.c.seq
        with reading(self._engine) as connection:
            found = connection.execute(query.order_by(order).limit(limit)).all()
        return [_shown(row) for row in found]

    def all_rows(self) -> Iterator[dict[str, Any]]:
        """Yield all rows, read in batches."""
        after = 0
        while rows := self.rows(after):
            yield from rows
            after = rows[-1]['seq']

    def verify(self, noted: str = '') -> ChainVerdict:
        """
        Check the chain from its first row to its head.

        :param noted: a head printed by an earlier check: that row must exist unmodified.
        """
        check = _Check(self._mac, noted)
        with reading(self._engine) as connection:
            after = 0
            head = connection.execute(select(audit_head)).one_or_none()
            last = head.seq if head is not None else 0
            while rows := connection.execute(select(audit).where(
                    audit.c.seq > after, audit.c.seq <= last).order_by(audit.c.seq)
                    .limit(_PAGE)).all():
                for row in rows:
                    check.add(row)
                after = rows[-1].seq
            beyond = connection.execute(select(audit.c.seq).where(audit.c.seq > last).limit(1)
                                        ).first()
        if head is None:
            check.problems.append('the head is missing')
        elif (head.seq, head.mac or _FIRST) != (check.seq, check.mac):
            check.problems.append(f'it ends with row {check.seq}, and its head says {head.seq}')
        elif head.seq and not hmac.compare_digest(head.seal, self._seal(head.seq, head.mac)):
            check.problems.append('the seal of the head is wrong')
        if beyond is not None and not self._came_since(last):
            check.problems.append(f'rows follow behind its head, {last}')
        return check.verdict()

    def is_ours(self) -> bool:
        """
        Return whether the audit was written with this key, or is empty.

        Writing with another key would break the chain for both keys. A valid seal or one valid row
        suffices: :meth:`verify` finds other changes, which do not prevent a start of the server.
        """
        with reading(self._engine) as connection:
            rows = connection.execute(select(audit).order_by(audit.c.seq.desc()).limit(_PAGE)
                                      ).all()
            head = connection.execute(select(audit_head)).one_or_none()
        if head is not None and hmac.compare_digest(head.seal, self._seal(head.seq, head.mac)):
            return True
        return not rows or any(self._is_good(row) for row in rows)

    def _is_good(self, row: Row[Any]) -> bool:
        return hmac.compare_digest(row.mac, self._mac([getattr(row, name) for name in _COLUMNS]))

    def _came_since(self, last: int) -> bool:
        """Return whether the head advanced while the chain was read."""
        with reading(self._engine) as connection:
            head = connection.execute(select(audit_head.c.seq)).scalar_one_or_none()
        return head is not None and head > last

    def _mac(self, values: list[Any]) -> str:
        text = json.dumps(values, ensure_ascii=True, separators=(',', ':'))
        return hmac.new(self._key, text.encode(), hashlib.sha256).hexdigest()

    def _seal(self, seq: int, mac: str) -> str:
        return self._mac(['head', seq, mac])


class _Check:
    """Checks the rows of the chain in order; it stores the first hundred problems."""

    def __init__(self, mac: Callable[[list[Any]], str], noted: str) -> None:
        self._mac_of = mac
        self._noted = noted
        self._noted_seq = int(noted.partition(':')[0]) if noted else 0
        self.seq = 0
        self.mac = _FIRST
        self.rows = 0
        self.problems: list[str] = []

    def add(self, row: Row[Any]) -> None:
        self.rows += 1
        if row.seq != self.seq + 1:
            self._tell(f'row {self.seq + 1} is missing' if row.seq == self.seq + 2 else
                       f'rows {self.seq + 1} to {row.seq - 1} are missing')
        elif row.previous != self.mac:
            self._tell(f'row {row.seq} does not follow on row {self.seq}')
        if not hmac.compare_digest(
                row.mac, self._mac_of([getattr(row, name) for name in _COLUMNS])):
            self._tell(f'row {row.seq} was changed')
        if row.seq == self._noted_seq and f'{row.seq}:{row.mac}' != self._noted:
            self._tell(f'row {row.seq} is not the one that was noted')
        self.seq, self.mac = row.seq, row.mac

    def _tell(self, problem: str) -> None:
        if len(self.problems) < 100:
            self.problems.append(problem)

    def verdict(self) -> ChainVerdict:
        if self._noted_seq > self.seq:
            self._tell(f'row {self._noted_seq}, which was noted, is missing')
        return ChainVerdict(self.rows, f'{self.seq}:{self.mac}', tuple(self.problems))


def _row(now_ns: int, actor: Subject, action: str, what: str,
         details: dict[str, Any]) -> dict[str, Any]:
    # Clients may send characters that PostgreSQL cannot store or that control a terminal.
    text = json.dumps(details, ensure_ascii=True, default=str, sort_keys=True)
    if len(text) > 4000:
        text = json.dumps({'cut': text[:3800]})
    return {'t_ns': now_ns, 'actor': _text(actor.id, 32), 'name': _text(actor.name, 64),
            'role': _text(str(getattr(actor.role, 'value', actor.role)), 16),
            'address': _text(actor.address, 64), 'action': _text(action, 64),
            'object': _text(what, 200), 'details': text}


def _text(text: str, longest: int) -> str:
    return safe_text(text)[:longest]


def _shown(row: Row[Any]) -> dict[str, Any]:
    found = dict(row._mapping)
    found['details'] = json.loads(found['details'])
    return found
