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

"""Accounts and the audit, whose rows the database itself keeps from being changed."""

from __future__ import annotations

from typing import Any
from typing import Final

from alembic import op
from sqlalchemy import BigInteger
from sqlalchemy import Boolean
from sqlalchemy import Column
from sqlalchemy import ForeignKey
from sqlalchemy import Index
from sqlalchemy import Integer
from sqlalchemy import MetaData
from sqlalchemy import String
from sqlalchemy import Table
from sqlalchemy import Text

revision: Final = '0002'
down_revision: Final = '0001'

_METADATA: Final = MetaData(naming_convention={
    'ix': 'ix_%(table_name)s_%(column_0_N_name)s',
    'uq': 'uq_%(table_name)s_%(column_0_N_name)s',
    'ck': 'ck_%(table_name)s_%(constraint_name)s',
    'fk': 'fk_%(table_name)s_%(column_0_N_name)s_%(referred_table_name)s',
    'pk': 'pk_%(table_name)s'})


def _text(name: str, length: int, **more: Any) -> Column[str]:
    return Column(name, String(length), nullable=False, **more)


def _ns(name: str, nullable: bool = False) -> Column[int]:
    return Column(name, BigInteger, nullable=nullable)


def _user(**more: Any) -> Column[str]:
    return Column('user', String(32), ForeignKey('users.id', ondelete='CASCADE'), **more)


Table(
    'users', _METADATA, _text('id', 32, primary_key=True), _text('name', 64),
    _text('key', 128, unique=True), _text('role', 16), Column('password', Text, nullable=False),
    Column('disabled', Boolean, nullable=False), _ns('created_ns'), _ns('password_ns'))
Table(
    'grants', _METADATA, _user(primary_key=True), _text('person', 128, primary_key=True),
    _ns('granted_ns'), _text('granted_by', 64))
Table(
    'sessions', _METADATA, _text('id', 32, primary_key=True), _text('token', 64, unique=True),
    _user(nullable=False, index=True), _ns('created_ns'), _ns('seen_ns'), _ns('expires_ns'),
    _text('address', 64), _text('browser', 200))
Table(
    'emergencies', _METADATA, _text('id', 32, primary_key=True),
    _user(nullable=False, index=True), _text('session', 32, index=True), _text('person', 128),
    Column('reason', Text, nullable=False), _ns('begins_ns'), _ns('ends_ns'))
Table(
    'invitations', _METADATA, _text('token', 64, primary_key=True),
    _user(nullable=True, index=True), _ns('created_ns'), _ns('expires_ns'))
Table(
    'robot_accounts', _METADATA, _text('id', 32, primary_key=True),
    _text('name', 64, unique=True), _text('token', 64, unique=True), _ns('created_ns'),
    _ns('revoked_ns', True))
Table(
    'audit', _METADATA,
    Column('seq', BigInteger().with_variant(Integer, 'sqlite'), primary_key=True,
           autoincrement=False),
    _ns('t_ns'), _text('actor', 32), _text('name', 64), _text('role', 16), _text('address', 64),
    _text('action', 64), _text('object', 200), Column('details', Text, nullable=False),
    _text('previous', 64), _text('mac', 64), Index('ix_audit_t_ns', 't_ns'),
    Index('ix_audit_name', 'name'), Index('ix_audit_action', 'action'))
_HEAD: Final = Table(
    'audit_head', _METADATA, Column('id', Integer, primary_key=True, autoincrement=False),
    _ns('seq'), _text('mac', 64), _text('seal', 64))

_SQLITE: Final = tuple(
    f'CREATE TRIGGER audit_no_{what.lower()} BEFORE {what} ON audit BEGIN '
    "SELECT RAISE(ABORT, 'rows of the audit are never changed'); END"
    for what in ('UPDATE', 'DELETE'))
_POSTGRES: Final = (
    'CREATE FUNCTION audit_is_kept() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN '
    "RAISE EXCEPTION 'rows of the audit are never changed'; END $$",
    'CREATE TRIGGER audit_no_change BEFORE UPDATE OR DELETE OR TRUNCATE ON audit '
    'FOR EACH STATEMENT EXECUTE FUNCTION audit_is_kept()')


def upgrade() -> None:
    """Make the tables."""
    connection = op.get_bind()
    _METADATA.create_all(connection, checkfirst=False)
    connection.execute(_HEAD.insert().values(id=1, seq=0, mac='', seal=''))
    for statement in _POSTGRES if connection.dialect.name == 'postgresql' else _SQLITE:
        connection.exec_driver_sql(statement)


def downgrade() -> None:
    """Drop them: accounts and audit are gone."""
    connection = op.get_bind()
    _METADATA.drop_all(connection, checkfirst=False)  # and the triggers with their table
    if connection.dialect.name == 'postgresql':
        connection.exec_driver_sql('DROP FUNCTION audit_is_kept()')
