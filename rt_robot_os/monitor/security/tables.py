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

"""The tables of accounts and of the audit; migration 0002 makes them."""

from __future__ import annotations

from typing import Final

from rt_robot_os.monitor.store.metadata import METADATA
from sqlalchemy import BigInteger
from sqlalchemy import Boolean
from sqlalchemy import Column
from sqlalchemy import ForeignKey
from sqlalchemy import Index
from sqlalchemy import Integer
from sqlalchemy import String
from sqlalchemy import Table
from sqlalchemy import Text

_ID: Final = 32
_HASH: Final = 64

#: ``key`` is the normalised name; ``password`` is empty until an invitation is used.
users: Final = Table(
    'users', METADATA,
    Column('id', String(_ID), primary_key=True),
    Column('name', String(64), nullable=False),
    Column('key', String(128), nullable=False, unique=True),
    Column('role', String(16), nullable=False),
    Column('password', Text, nullable=False),
    Column('disabled', Boolean, nullable=False),
    Column('created_ns', BigInteger, nullable=False),
    Column('password_ns', BigInteger, nullable=False))

#: The people a user may see; ``*`` means all.
grants: Final = Table(
    'grants', METADATA,
    Column('user', String(_ID), ForeignKey('users.id', ondelete='CASCADE'), primary_key=True),
    Column('person', String(128), primary_key=True),
    Column('granted_ns', BigInteger, nullable=False),
    Column('granted_by', String(64), nullable=False))

#: Only a hash of the cookie is stored, which is useless to a reader of the table.
sessions: Final = Table(
    'sessions', METADATA,
    Column('id', String(_ID), primary_key=True),
    Column('token', String(_HASH), nullable=False, unique=True),
    Column('user', String(_ID), ForeignKey('users.id', ondelete='CASCADE'), nullable=False,
           index=True),
    Column('created_ns', BigInteger, nullable=False),
    Column('seen_ns', BigInteger, nullable=False),
    Column('expires_ns', BigInteger, nullable=False),
    Column('address', String(64), nullable=False),
    Column('browser', String(200), nullable=False))

#: Emergency access of users; it also ends with the session.
emergencies: Final = Table(
    'emergencies', METADATA,
    Column('id', String(_ID), primary_key=True),
    Column('user', String(_ID), ForeignKey('users.id', ondelete='CASCADE'), nullable=False,
           index=True),
    Column('session', String(_ID), nullable=False, index=True),
    Column('person', String(128), nullable=False),
    Column('reason', Text, nullable=False),
    Column('begins_ns', BigInteger, nullable=False),
    Column('ends_ns', BigInteger, nullable=False))

#: One-time links; ``user`` is empty for the first account.
invitations: Final = Table(
    'invitations', METADATA,
    Column('token', String(_HASH), primary_key=True),
    Column('user', String(_ID), ForeignKey('users.id', ondelete='CASCADE'), nullable=True,
           index=True),
    Column('created_ns', BigInteger, nullable=False),
    Column('expires_ns', BigInteger, nullable=False))

#: A revoked robot keeps its row, because its records refer to it.
robot_accounts: Final = Table(
    'robot_accounts', METADATA,
    Column('id', String(_ID), primary_key=True),
    Column('name', String(64), nullable=False, unique=True),
    Column('token', String(_HASH), nullable=False, unique=True),
    Column('created_ns', BigInteger, nullable=False),
    Column('revoked_ns', BigInteger, nullable=True))

#: Rows are added and never changed; triggers enforce this.
audit: Final = Table(
    'audit', METADATA,
    Column('seq', BigInteger().with_variant(Integer, 'sqlite'), primary_key=True,
           autoincrement=False),
    Column('t_ns', BigInteger, nullable=False),
    Column('actor', String(_ID), nullable=False),
    Column('name', String(64), nullable=False),
    Column('role', String(16), nullable=False),
    Column('address', String(64), nullable=False),
    Column('action', String(64), nullable=False),
    Column('object', String(200), nullable=False),
    Column('details', Text, nullable=False),
    Column('previous', String(_HASH), nullable=False),
    Column('mac', String(_HASH), nullable=False),
    Index('ix_audit_t_ns', 't_ns'),
    Index('ix_audit_name', 'name'),
    Index('ix_audit_action', 'action'))

#: One row: the length and the end of the chain, so that rows missing at the end are detected.
audit_head: Final = Table(
    'audit_head', METADATA,
    Column('id', Integer, primary_key=True, autoincrement=False),
    Column('seq', BigInteger, nullable=False),
    Column('mac', String(_HASH), nullable=False),
    Column('seal', String(_HASH), nullable=False))
