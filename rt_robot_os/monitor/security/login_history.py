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

"""Restores the limits of wrong passwords from the logins in the audit after a restart."""

from __future__ import annotations

import json
from typing import Any
from typing import Final

from rt_robot_os.monitor.security.limits import LockOut
from rt_robot_os.monitor.security.tables import audit
from rt_robot_os.monitor.security.users import key_of
from rt_robot_os.monitor.store.engine import reading
from sqlalchemy import Engine
from sqlalchemy import Row
from sqlalchemy import select

#: How long an address counts as known after a login.
KNOWN_S: Final = 30 * 24 * 3600
#: Most rows read at a start, the newest ones.
ROWS_MOST: Final = 20_000
SECOND_NS: Final = 1_000_000_000
RIGHT: Final = frozenset({'session.begin', 'session.unlock', 'session.set_up', 'password.change'})
WRONG: Final = frozenset({'session.refused', 'session.unlock_refused', 'password.refused'})


def restore_limits(engine: Engine, lock_out: LockOut, now_ns: int) -> None:
    """
    Pass the logins before this start to the limits of wrong passwords.

    :param now_ns: UTC.
    :raises StoreError: the database cannot be read.
    """
    for row in _rows(engine, now_ns):
        lock_out.restore(key_of(row.name), row.address, _device(row.details), now_ns - row.t_ns,
                         row.action in RIGHT)


def _rows(engine: Engine, now_ns: int) -> list[Row[Any]]:
    """Return rows of logins, the oldest first."""
    with reading(engine) as connection:
        rows = connection.execute(
            select(audit.c.t_ns, audit.c.name, audit.c.address, audit.c.action, audit.c.details)
            .where(audit.c.action.in_(RIGHT | WRONG), audit.c.t_ns > now_ns - KNOWN_S * SECOND_NS)
            .order_by(audit.c.seq.desc()).limit(ROWS_MOST)).all()
    return list(reversed(rows))


def _device(details: str) -> str:
    found = json.loads(details)
    device = found.get('device', '') if isinstance(found, dict) else ''
    return device if isinstance(device, str) else ''
