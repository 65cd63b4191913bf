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
The database of the monitor, as used by the server.

Every method may be called from any thread, and blocks: from asyncio call it in a thread, and write
records through :class:`~rt_robot_os.monitor.store.writer.RecordWriter`. ``people`` limits the
result to residents that the account may see; None means all.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
from contextlib import contextmanager
import json
import time
from types import MappingProxyType
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.errors import StartError
from rt_robot_os.base.errors import StoreError
from rt_robot_os.monitor.store import alarm_queries
from rt_robot_os.monitor.store import queries
from rt_robot_os.monitor.store.adding import Added
from rt_robot_os.monitor.store.adding import Adding
from rt_robot_os.monitor.store.adding import ReceivedBatch
from rt_robot_os.monitor.store.charts import chart as make_chart
from rt_robot_os.monitor.store.charts import SignChart
from rt_robot_os.monitor.store.codes import unit_of
from rt_robot_os.monitor.store.engine import open_engine
from rt_robot_os.monitor.store.engine import POSTGRES
from rt_robot_os.monitor.store.engine import read_url
from rt_robot_os.monitor.store.engine import reading
from rt_robot_os.monitor.store.engine import writing
from rt_robot_os.monitor.store.erasure import erase
from rt_robot_os.monitor.store.erasure import Erased
from rt_robot_os.monitor.store.housekeeping import Housekeeping
from rt_robot_os.monitor.store.migrate import upgrade
from rt_robot_os.monitor.store.names import NameTable
from rt_robot_os.monitor.store.retention import RetentionPolicy
from rt_robot_os.monitor.store.retention import thin
from rt_robot_os.monitor.store.rollups import roll_up
from rt_robot_os.monitor.store.sole_server import SoleServer
from rt_robot_os.monitor.store.tables import ROBOTS
from rt_robot_os.monitor.store.unconfirmed import file_confirmed
from sqlalchemy import Connection
from sqlalchemy import Engine
from sqlalchemy import update
from sqlalchemy import URL
from sqlalchemy.exc import DBAPIError
from sqlalchemy.exc import IntegrityError

#: The newest rows are rolled up at this number or age, since charts read each of them.
_ROLL_UP_ROWS: Final = 10_000
_ROLL_UP_S: Final = 10.0


class Hello(NamedTuple):
    """The data a robot sent about itself when it connected."""

    robot: str
    boot: str
    name: str = ''
    details: Mapping[str, Any] = MappingProxyType({})


def _advice(url: URL) -> str:
    if url.get_backend_name() == POSTGRES:
        return 'Is PostgreSQL running, and may this account write to the database?'
    return 'Is it a database of the monitor, and may this user write to it?'


class Store:
    """
    An open database; made by :meth:`open`.

    :ivar engine: the SQLAlchemy engine; parts of the server with their own tables use
        :meth:`reading` and :meth:`writing`.
    :ivar counts: records since the start, by result.
    """

    def __init__(self, engine: Engine, now_ns: Callable[[], int] = time.time_ns) -> None:
        self.engine = engine
        self.now_ns = now_ns
        self.counts = {name: 0 for name in Added._fields}
        self.housekeeping: Housekeeping | None = None
        self._sole: SoleServer | None = None
        self._names = NameTable()
        self._not_rolled = _ROLL_UP_ROWS
        self._rolled_s = 0.0

    @classmethod
    def open(cls, url: str, now_ns: Callable[[], int] = time.time_ns) -> Store:  # noqa: A003
        """
        Open a database and upgrade it to the version of this release.

        :param url: ``sqlite:////path``, a path, or ``postgresql://user@host/name``.
        :param now_ns: UTC.
        :raises StartError: it cannot be opened; the message gives a remedy.
        """
        target = read_url(url)
        engine = open_engine(target)
        shown = target.render_as_string(hide_password=True)
        try:
            upgrade(engine)
        except StoreError as error:
            engine.dispose()
            raise StartError(f'{shown}: {error}. {_advice(target)}') from error
        except DBAPIError as error:
            engine.dispose()
            first = ''.join(str(error.orig).strip().splitlines()[:1])[:200]
            raise StartError(f'{shown}: {first}. {_advice(target)}') from error
        except BaseException:
            engine.dispose()
            raise
        return cls(engine, now_ns)

    def close(self) -> None:
        """Close all connections."""
        if self.housekeeping is not None:
            self.housekeeping.close()
        self.engine.dispose()
        if self._sole is not None:
            self._sole.release()

    def serve_alone(self) -> None:
        """
        Lock this database against other servers until it is closed.

        :raises StartError: another server uses it.
        """
        sole = SoleServer(self.engine)
        sole.acquire()
        self._sole = sole

    def other_server(self) -> str:
        """Return an error if another server took the database meanwhile, or empty."""
        return '' if self._sole is None else self._sole.check()

    @contextmanager
    def reading(self) -> Iterator[Connection]:
        """
        Yield a connection that sees one state of the database.

        :raises StoreError: the database is unavailable.
        """
        with reading(self.engine) as connection:
            yield connection

    @contextmanager
    def writing(self) -> Iterator[Connection]:
        """
        Yield a connection that writes, one at a time; commit at the end.

        :raises StoreError: the database is unavailable or full; nothing is written.
        """
        with writing(self.engine) as connection:
            yield connection

    # ---- records -----------------------------------------------------------------------------

    def add(self, robot: str, boot: str, records: Sequence[Mapping[str, Any]]) -> int:
        """
        Add records of a start of a robot: ``seq``, ``type``, ``utc_ns``, ``content``.

        :return: the number of new records; they are on the disk.
        :raises StoreError: the database is unavailable or full; none of them is added.
        """
        return self.add_all([ReceivedBatch(robot, boot, records)])[0].fresh

    def add_all(self, batches: Sequence[ReceivedBatch]) -> list[Added]:
        """
        Add batches in one transaction, like :meth:`add`.

        :return: the result for each batch.
        """
        try:
            added = self._add(batches)
        except IntegrityError:
            # Another process has deleted a row whose id is cached here.
            self._names.forget()
            added = self._add(batches)
        for each in added:
            for name, count in each._asdict().items():
                self.counts[name] += count
        self._not_rolled += sum(each.fresh for each in added)
        if self._not_rolled >= _ROLL_UP_ROWS or self._rolled_s + _ROLL_UP_S < time.monotonic():
            self._rolled_s = time.monotonic()
            try:
                self.roll_up()
            except StoreError:
                pass  # The records are stored, and are rolled up the next time.
        return added

    def roll_up(self) -> int:
        """Roll up a part of the newer rows; return the most rows that are left."""
        with self.writing() as connection:
            left = roll_up(connection)
        self._not_rolled, self._rolled_s = left, time.monotonic()
        return left

    def _add(self, batches: Sequence[ReceivedBatch]) -> list[Added]:
        try:
            with self.writing() as connection:
                adding = Adding(connection, self._names, self.now_ns())
                added = adding.add(batches)
                adding.save()
        except BaseException:
            self._names.forget()
            raise
        return added

    def hello(self, robot: str, boot: str, *, name: str = '',
              details: Mapping[str, Any] | None = None) -> None:
        """Store the hello of a robot."""
        self.hello_all([Hello(robot, boot, name, details or {})])

    def hello_all(self, hellos: Sequence[Hello]) -> None:
        """
        Store hellos of robots, in one transaction.

        :raises StoreError: the database is unavailable or full; none is stored.
        """
        try:
            with self.writing() as connection:
                for each in hellos:
                    self._hello(connection, each, self.now_ns())
        except BaseException:
            self._names.forget()
            raise

    def _hello(self, connection: Connection, hello: Hello, now_ns: int) -> None:
        number = self._names.robot(connection, hello.robot, now_ns)
        self._names.boot(connection, number, hello.boot, now_ns)
        values: dict[str, Any] = {'last_ns': now_ns, 'details': json.dumps(hello.details)}
        if hello.name:
            values['name'] = hello.name
        connection.execute(update(ROBOTS).where(ROBOTS.c.id == number), values)

    def file_confirmed(self) -> int:
        """
        File the records stored aside whose person has been confirmed as a resident since.

        :return: how many.
        :raises StoreError: the database is unavailable or full; the rest stays aside.
        """
        count, after = 0, 0
        while True:
            try:
                with self.writing() as connection:
                    filed, last = file_confirmed(connection, self._names, after)
            except BaseException:
                self._names.forget()
                raise
            count += filed
            if last is None:
                return count
            after = last

    # ---- robots and people -------------------------------------------------------------------

    def robots(self) -> list[dict[str, Any]]:
        """Return all robots: id, name, first_ns, last_seen_ns, people, details."""
        with self.reading() as connection:
            return queries.robots(connection)

    def people(self) -> list[dict[str, Any]]:
        """Return all people: person, robots, signs, first_ns."""
        with self.reading() as connection:
            return queries.people(connection)

    def observations(self, person: str, sign: str | None = None, start: int | None = None,
                     end: int | None = None, limit: int = 1000,
                     after: tuple[int, int] | None = None) -> list[dict[str, Any]]:
        """
        Return observations in order of time.

        :param start: UTC in ns, inclusive; ``end`` is exclusive.
        :param after: (t_ns, id) of the last one of the page before.
        """
        with self.reading() as connection:
            return queries.observations(connection, person, sign, start, end, limit, after)

    def latest(self, people: frozenset[str] | None = None) -> list[dict[str, Any]]:
        """Return the newest observation of each sign of these people."""
        with self.reading() as connection:
            return queries.latest(connection, people)

    def places(self, person: str, start_ns: int, end_ns: int, limit: int = 1000
               ) -> list[dict[str, Any]]:
        """Return the places of a person: robot, x, y, room, t_ns."""
        with self.reading() as connection:
            return queries.places(connection, person, start_ns, end_ns, limit)

    def events(self, robot: str, start_ns: int, end_ns: int, limit: int = 1000
               ) -> list[dict[str, Any]]:
        """Return actions of a robot's agent and operators: type, t_ns, content."""
        with self.reading() as connection:
            return queries.events(connection, robot, start_ns, end_ns, limit)

    def nodes(self, robot: str) -> list[dict[str, Any]]:
        """Return the last record about each node: node, t_ns, content."""
        with self.reading() as connection:
            return queries.nodes(connection, robot)

    def chart(self, person: str, sign: str, start_ns: int, end_ns: int, pixels: int) -> SignChart:
        """
        Return lowest, mean and highest value of each of a limited number of spans, with alarms.

        :param start_ns: UTC; ``end_ns`` is exclusive.
        """
        with self.reading() as connection:
            made = make_chart(connection, person, sign, unit_of(sign), start_ns, end_ns, pixels)
            made.alarms = alarm_queries.alarms_within(connection, person, start_ns, end_ns)
            made.limits = queries.limits(connection, person, sign)
            return made

    def keep(self, kept: RetentionPolicy) -> None:
        """Delete expired rows each hour until the store is closed."""
        self.housekeeping = Housekeeping(lambda: self.thin(kept))

    def thin(self, kept: RetentionPolicy) -> dict[str, int]:
        """Delete expired rows; return the number of deleted rows, by table."""
        return thin(self.engine, kept, self.now_ns())

    def erase(self, person: str, with_account: bool = False) -> Erased:
        """
        Delete a person: their measurements, alarms about them, and their name everywhere else.

        Later records about them are stored aside: remove the person from the robots' settings
        first.
        """
        try:
            return erase(self.engine, person, with_account)
        finally:
            self._names.forget()

    def forget_names(self) -> None:
        """
        Discard cached names of people, because some were erased.

        :raises StoreError: the database is unavailable.
        """
        with self.writing():  # not while records are being added
            self._names.forget()

    def unknown(self, limit: int = 1000) -> list[dict[str, Any]]:
        """Return records stored aside, the newest first: robot, type, why, content."""
        with self.reading() as connection:
            return queries.unknown(connection, limit)

    # ---- alarms ------------------------------------------------------------------------------

    def alarms(self, *, people: frozenset[str] | None, robot: str | None = None,
               is_open: bool | None = None, since_ns: int = 0, limit: int = 200
               ) -> list[dict[str, Any]]:
        """Return alarms that may be seen, the most recently changed first."""
        with self.reading() as connection:
            return alarm_queries.alarms(connection, people, robot, is_open, since_ns, limit)

    def alarm(self, robot: str, id: str) -> dict[str, Any] | None:  # noqa: A002
        """Return an alarm with ``events``, ``notes`` and ``media``; None when there is none."""
        with self.reading() as connection:
            return alarm_queries.alarm(connection, robot, id)

    def add_note(self, robot: str, alarm: str, by: str, text: str) -> int | None:
        """Add a note to an alarm; return its number, None when there is no such alarm."""
        with self.writing() as connection:
            return alarm_queries.add_note(connection, robot, alarm, by, text, self.now_ns())

    def withdraw_note(self, note: int, robot: str, alarm: str, by: str, within_s: float
                      ) -> str | None:
        """Delete a note that its author wrote recently; return its text, None if missing."""
        with self.writing() as connection:
            return alarm_queries.withdraw_note(connection, note, robot, alarm, by,
                                               self.now_ns() - int(within_s * 1e9))

    # ---- media -------------------------------------------------------------------------------

    def media(self, id: int) -> dict[str, Any] | None:  # noqa: A002
        """Return a picture, clip or sound; ``path`` is empty until the server has its bytes."""
        with self.reading() as connection:
            return alarm_queries.media(connection, id)

    def media_of(self, robot: str, alarm: str) -> list[dict[str, Any]]:
        """Return the media of an alarm, the oldest first."""
        with self.reading() as connection:
            return alarm_queries.media_of(connection, robot, alarm)

    def media_list(self, robot: str | None = None, alarm: str | None = None, limit: int = 100
                   ) -> list[dict[str, Any]]:
        """Return pictures, clips and sounds, the newest first."""
        with self.reading() as connection:
            return alarm_queries.media_list(connection, robot, alarm, limit)

    def media_by_name(self, robot: str, media: str) -> dict[str, Any] | None:
        """Return a picture, clip or sound by the id that its robot gave it."""
        with self.reading() as connection:
            return alarm_queries.media_by_name(connection, robot, media)
