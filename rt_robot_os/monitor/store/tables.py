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
The tables of records. Times are UTC in ns since 1970; columns named ``content`` are JSON.

A record is identified by (boot, seq), and ``received`` has a bit for each: a duplicate is
recognised even when its row expired or was erased long ago. Names of robots, people and signs have
one table each; other rows refer to their ids.
"""

from __future__ import annotations

from typing import Any
from typing import Final

from rt_robot_os.monitor.store.metadata import Key
from rt_robot_os.monitor.store.metadata import METADATA
from sqlalchemy import BigInteger
from sqlalchemy import Boolean
from sqlalchemy import Column
from sqlalchemy import Double
from sqlalchemy import false
from sqlalchemy import ForeignKey
from sqlalchemy import Index
from sqlalchemy import Integer
from sqlalchemy import LargeBinary
from sqlalchemy import SmallInteger
from sqlalchemy import String
from sqlalchemy import Table
from sqlalchemy import Text
from sqlalchemy import UniqueConstraint

#: Longest name of any kind.
NAME: Final = 120


def _id() -> Column[int]:
    return Column('id', Key, primary_key=True)


def _to(table: str, **more: Any) -> Column[int]:
    """Return a foreign key column."""
    name = {'people': 'person_id', 'series': 'series_id'}.get(table, f'{table[:-1]}_id')
    return Column(name, BigInteger, ForeignKey(f'{table}.id', **more), nullable=False)


def _ns(name: str, nullable: bool = False) -> Column[int]:
    return Column(name, BigInteger, nullable=nullable)


def _text(name: str) -> Column[str]:
    return Column(name, Text, nullable=False, server_default='')


def _name(name: str) -> Column[str]:
    return Column(name, String(NAME), nullable=False, server_default='')


def _sent() -> tuple[Column[int], ...]:
    """Return the columns that identify a record of a robot."""
    return (_id(), _to('boots'), Column('seq', BigInteger, nullable=False), _ns('t_ns'),
            _ns('arrived_ns'))


# ---- who and what ------------------------------------------------------------------------------

#: ``robot`` is its id outside of the database, ``details`` the last hello; ``residents`` states
#: how its residents were confirmed, see :mod:`~rt_robot_os.monitor.security.residents`.
ROBOTS: Final = Table(
    'robots', METADATA, _id(), Column('robot', String(NAME), nullable=False, unique=True),
    _name('name'), _ns('first_ns'), _ns('last_ns'), _text('details'),
    Column('residents', String(16), nullable=False, server_default=''),
    sqlite_autoincrement=True)
BOOTS: Final = Table(
    'boots', METADATA, _id(), _to('robots'), Column('boot', String(NAME), nullable=False),
    _ns('first_ns'), _ns('last_ns'), Column('blocks', BigInteger, nullable=False),
    UniqueConstraint('robot_id', 'boot'),
    sqlite_autoincrement=True)
#: Bits of the received numbers of a block; empty bits mean a full block. The first ``blocks`` of a
#: start are all full, and have no row.
RECEIVED: Final = Table(
    'received', METADATA,
    Column('boot_id', BigInteger, ForeignKey('boots.id'), primary_key=True, autoincrement=False),
    Column('block', BigInteger, primary_key=True, autoincrement=False),
    Column('bits', LargeBinary, nullable=False))
PEOPLE: Final = Table(
    'people', METADATA, _id(), Column('person', String(NAME), nullable=False, unique=True),
    _ns('first_ns'), sqlite_autoincrement=True)
#: ``lives``: an administrator confirmed that the person lives with the robot now; otherwise there
#: are only records of the past.
ROBOT_PEOPLE: Final = Table(
    'robot_people', METADATA,
    Column('robot_id', BigInteger, ForeignKey('robots.id'), primary_key=True),
    Column('person_id', BigInteger, ForeignKey('people.id', ondelete='CASCADE'),
           primary_key=True),
    Column('lives', Boolean, nullable=False, server_default=false()),
    Column('set_ns', BigInteger, nullable=False, server_default='0'),
    Column('set_by', String(64), nullable=False, server_default=''))
#: A sign of a person.
SERIES: Final = Table(
    'series', METADATA, _id(), _to('people', ondelete='CASCADE'),
    Column('code', String(NAME), nullable=False), UniqueConstraint('person_id', 'code'),
    sqlite_autoincrement=True)

# ---- observations ------------------------------------------------------------------------------

#: ``quality`` as in records.QUALITIES; ``value`` is NULL when there was none. Ids are never
#: reused, even when the newest row was deleted: roll-ups depend on them.
OBSERVATIONS: Final = Table(
    'observations', METADATA, *_sent(), _to('series', ondelete='CASCADE'),
    Column('value', Double), Column('quality', SmallInteger, nullable=False), _name('source'),
    Index(None, 'series_id', 't_ns', 'quality', 'value'), sqlite_autoincrement=True)


def _rollup(name: str) -> Table:
    return Table(
        name, METADATA,
        Column('series_id', BigInteger, ForeignKey('series.id', ondelete='CASCADE'),
               primary_key=True),
        Column('t_ns', BigInteger, primary_key=True),
        Column('low', Double, nullable=False), Column('high', Double, nullable=False),
        Column('total', Double, nullable=False), Column('count', BigInteger, nullable=False),
        sqlite_with_rowid=False)


MINUTES: Final = _rollup('minutes')
HOURS: Final = _rollup('hours')
DAYS: Final = _rollup('days')
#: Counters of the store itself.
PROGRESS: Final = Table(
    'progress', METADATA, Column('name', String(NAME), primary_key=True),
    Column('value', BigInteger, nullable=False))

# ---- alarms ------------------------------------------------------------------------------------

#: State of each alarm, computed from its events; ``last_seq`` is that of the newest event.
ALARMS: Final = Table(
    'alarms', METADATA, _id(), _to('robots'), Column('alarm', String(NAME), nullable=False),
    _name('subject'), _name('state'), _name('level'), _text('kinds'), _text('text'), _text('by'),
    _text('why'), _name('node'), Column('x', Double), Column('y', Double),
    _ns('opened_ns'), _ns('t_ns'), _ns('raised_ns', nullable=True),
    _ns('acknowledged_ns', nullable=True), _text('acknowledged_by'),
    Column('is_open', Boolean, nullable=False, server_default=false()), _ns('last_seq'),
    _ns('place_seq'), _ns('acknowledged_seq'),
    UniqueConstraint('robot_id', 'alarm'), Index(None, 'is_open', 't_ns'),
    Index(None, 't_ns'))
ALARM_EVENTS: Final = Table(
    'alarm_events', METADATA, *_sent(), _to('alarms', ondelete='CASCADE'), _ns('event_seq'),
    _name('event'), _text('content'), Index(None, 'alarm_id', 'event_seq'))
ALARM_NOTES: Final = Table(
    'alarm_notes', METADATA, _id(), _to('alarms', ondelete='CASCADE'), _ns('t_ns'), _name('by'),
    _text('text'), Index(None, 'alarm_id'))

# ---- the rest ----------------------------------------------------------------------------------

#: Actions of the agent and operators, and log lines.
EVENTS: Final = Table(
    'events', METADATA, *_sent(), _to('robots'), _name('type'), _text('content'),
    Index(None, 'robot_id', 't_ns'))
PLACES: Final = Table(
    'places', METADATA, *_sent(), _to('people', ondelete='CASCADE'), Column('x', Double),
    Column('y', Double), _name('room'), Index(None, 'person_id', 't_ns'))
NODES: Final = Table(
    'nodes', METADATA, *_sent(), _to('robots'), Column('node', String(NAME), nullable=False),
    _text('content'), Index(None, 'robot_id', 'node', 't_ns'))
#: ``media`` is the robot's name for the file; ``path`` is that on the server, empty until
#: received.
MEDIA: Final = Table(
    'media', METADATA, *_sent(), _to('robots'), Column('media', String(NAME), nullable=False),
    _name('alarm'), _name('kind'), _text('file'), _name('sha256'),
    Column('size', BigInteger, nullable=False), Column('width', Integer, nullable=False),
    Column('height', Integer, nullable=False), _text('path'), _ns('stored_ns', nullable=True),
    UniqueConstraint('robot_id', 'media'), Index(None, 'robot_id', 'alarm'))
#: Records that are invalid for this release, unmodified but truncated.
UNKNOWN: Final = Table(
    'unknown', METADATA, _id(), _to('boots'), Column('seq', BigInteger), _ns('arrived_ns'),
    _name('type'), _text('why'), _text('content'), Index(None, 'boot_id', 'seq'))
