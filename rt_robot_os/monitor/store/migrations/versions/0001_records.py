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
Records of robots and people.

The tables as they were then, written again: what becomes of them in
:mod:`~rt_robot_os.monitor.store.tables` later must not change what this step makes.
"""

from __future__ import annotations

from typing import Any
from typing import Final

from alembic import op
from sqlalchemy import BigInteger
from sqlalchemy import Boolean
from sqlalchemy import Column
from sqlalchemy import Double
from sqlalchemy import false
from sqlalchemy import ForeignKey
from sqlalchemy import Index
from sqlalchemy import Integer
from sqlalchemy import LargeBinary
from sqlalchemy import MetaData
from sqlalchemy import SmallInteger
from sqlalchemy import String
from sqlalchemy import Table
from sqlalchemy import Text
from sqlalchemy import UniqueConstraint

revision: Final = '0001'
down_revision: Final = None

_Key: Final = BigInteger().with_variant(Integer(), 'sqlite')
_METADATA: Final = MetaData(naming_convention={
    'ix': 'ix_%(table_name)s_%(column_0_N_name)s',
    'uq': 'uq_%(table_name)s_%(column_0_N_name)s',
    'ck': 'ck_%(table_name)s_%(constraint_name)s',
    'fk': 'fk_%(table_name)s_%(column_0_N_name)s_%(referred_table_name)s',
    'pk': 'pk_%(table_name)s'})


def _id() -> Column[int]:
    return Column('id', _Key, primary_key=True)


def _to(table: str, **more: Any) -> Column[int]:
    name = {'people': 'person_id', 'series': 'series_id'}.get(table, f'{table[:-1]}_id')
    return Column(name, BigInteger, ForeignKey(f'{table}.id', **more), nullable=False)


def _ns(name: str, nullable: bool = False) -> Column[int]:
    return Column(name, BigInteger, nullable=nullable)


def _text(name: str) -> Column[str]:
    return Column(name, Text, nullable=False, server_default='')


def _name(name: str) -> Column[str]:
    return Column(name, String(120), nullable=False, server_default='')


def _sent() -> tuple[Column[int], ...]:
    return (_id(), _to('boots'), Column('seq', BigInteger, nullable=False), _ns('t_ns'),
            _ns('arrived_ns'))


Table(
    'robots', _METADATA, _id(), Column('robot', String(120), nullable=False, unique=True),
    _name('name'), _ns('first_ns'), _ns('last_ns'), _text('details'), sqlite_autoincrement=True)
Table(
    'boots', _METADATA, _id(), _to('robots'), Column('boot', String(120), nullable=False),
    _ns('first_ns'), _ns('last_ns'), Column('blocks', BigInteger, nullable=False),
    UniqueConstraint('robot_id', 'boot'),
    sqlite_autoincrement=True)
Table(
    'received', _METADATA,
    Column('boot_id', BigInteger, ForeignKey('boots.id'), primary_key=True, autoincrement=False),
    Column('block', BigInteger, primary_key=True, autoincrement=False),
    Column('bits', LargeBinary, nullable=False))
Table(
    'people', _METADATA, _id(), Column('person', String(120), nullable=False, unique=True),
    _ns('first_ns'), sqlite_autoincrement=True)
Table(
    'robot_people', _METADATA,
    Column('robot_id', BigInteger, ForeignKey('robots.id'), primary_key=True),
    Column('person_id', BigInteger, ForeignKey('people.id', ondelete='CASCADE'),
           primary_key=True))
Table(
    'series', _METADATA, _id(), _to('people', ondelete='CASCADE'),
    Column('code', String(120), nullable=False), UniqueConstraint('person_id', 'code'),
    sqlite_autoincrement=True)


Table(
    'observations', _METADATA, *_sent(), _to('series', ondelete='CASCADE'),
    Column('value', Double), Column('quality', SmallInteger, nullable=False), _name('source'),
    Index(None, 'series_id', 't_ns', 'quality', 'value'), sqlite_autoincrement=True)


def _rollup(name: str) -> Table:
    return Table(
        name, _METADATA,
        Column('series_id', BigInteger, ForeignKey('series.id', ondelete='CASCADE'),
               primary_key=True),
        Column('t_ns', BigInteger, primary_key=True),
        Column('low', Double, nullable=False), Column('high', Double, nullable=False),
        Column('total', Double, nullable=False), Column('count', BigInteger, nullable=False),
        sqlite_with_rowid=False)


_rollup('minutes')
_rollup('hours')
_rollup('days')
Table(
    'progress', _METADATA, Column('name', String(120), primary_key=True),
    Column('value', BigInteger, nullable=False))


Table(
    'alarms', _METADATA, _id(), _to('robots'), Column('alarm', String(120), nullable=False),
    _name('subject'), _name('state'), _name('level'), _text('kinds'), _text('text'), _text('by'),
    _text('why'), _name('node'), Column('x', Double), Column('y', Double),
    _ns('opened_ns'), _ns('t_ns'), _ns('raised_ns', nullable=True),
    _ns('acknowledged_ns', nullable=True), _text('acknowledged_by'),
    Column('is_open', Boolean, nullable=False, server_default=false()), _ns('last_seq'),
    _ns('place_seq'), _ns('acknowledged_seq'),
    UniqueConstraint('robot_id', 'alarm'), Index(None, 'is_open', 't_ns'),
    Index(None, 't_ns'))
Table(
    'alarm_events', _METADATA, *_sent(), _to('alarms', ondelete='CASCADE'), _ns('event_seq'),
    _name('event'), _text('content'), Index(None, 'alarm_id', 'event_seq'))
Table(
    'alarm_notes', _METADATA, _id(), _to('alarms', ondelete='CASCADE'), _ns('t_ns'), _name('by'),
    _text('text'), Index(None, 'alarm_id'))


Table(
    'events', _METADATA, *_sent(), _to('robots'), _name('type'), _text('content'),
    Index(None, 'robot_id', 't_ns'))
Table(
    'places', _METADATA, *_sent(), _to('people', ondelete='CASCADE'), Column('x', Double),
    Column('y', Double), _name('room'), Index(None, 'person_id', 't_ns'))
Table(
    'nodes', _METADATA, *_sent(), _to('robots'), Column('node', String(120), nullable=False),
    _text('content'), Index(None, 'robot_id', 'node', 't_ns'))
Table(
    'media', _METADATA, *_sent(), _to('robots'), Column('media', String(120), nullable=False),
    _name('alarm'), _name('kind'), _text('file'), _name('sha256'),
    Column('size', BigInteger, nullable=False), Column('width', Integer, nullable=False),
    Column('height', Integer, nullable=False), _text('path'), _ns('stored_ns', nullable=True),
    UniqueConstraint('robot_id', 'media'), Index(None, 'robot_id', 'alarm'))
Table(
    'unknown', _METADATA, _id(), _to('boots'), Column('seq', BigInteger), _ns('arrived_ns'),
    _name('type'), _text('why'), _text('content'), Index(None, 'boot_id', 'seq'))


def upgrade() -> None:
    """Make the tables of records."""
    _METADATA.create_all(op.get_bind(), checkfirst=False)


def downgrade() -> None:
    """Drop them."""
    _METADATA.drop_all(op.get_bind(), checkfirst=False)
