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
Records about people who were not confirmed as residents of their robot when the records came.

They are stored aside unmodified, and filed when an administrator has confirmed the person. Like
all records aside they are kept for ``network_days``.
"""

from __future__ import annotations

import json
from typing import Any
from typing import Final

from rt_robot_os.monitor.store.adding import write
from rt_robot_os.monitor.store.metadata import METADATA
from rt_robot_os.monitor.store.names import NameTable
from rt_robot_os.monitor.store.records import read
from rt_robot_os.monitor.store.records import Sent
from rt_robot_os.monitor.store.tables import BOOTS
from rt_robot_os.monitor.store.tables import PEOPLE
from rt_robot_os.monitor.store.tables import ROBOT_PEOPLE
from rt_robot_os.monitor.store.tables import UNKNOWN
from sqlalchemy import Connection
from sqlalchemy import delete
from sqlalchemy import select

#: The type of such a record; its content has the original ``type`` and ``content``.
UNCONFIRMED: Final = 'unconfirmed'
#: Most records that one transaction reads.
STEP: Final = 1000


def file_confirmed(connection: Connection, names: NameTable, after: int) -> tuple[int, int | None]:
    """
    File a part of the records whose person has been confirmed since.

    :param after: the id of the last row that was read.
    :return: how many were filed, and the id of the last row; None at the end.
    """
    rows = connection.execute(select(UNKNOWN, BOOTS.c.robot_id).join(
        BOOTS, BOOTS.c.id == UNKNOWN.c.boot_id).where(
            UNKNOWN.c.type == UNCONFIRMED, UNKNOWN.c.id > after).order_by(
                UNKNOWN.c.id).limit(STEP)).all()
    if not rows:
        return 0, None
    lives = {(row.robot_id, row.person) for row in connection.execute(select(
        ROBOT_PEOPLE.c.robot_id, PEOPLE.c.person).join(
            PEOPLE, PEOPLE.c.id == ROBOT_PEOPLE.c.person_id).where(ROBOT_PEOPLE.c.lives))}
    tables: dict[str, list[dict[str, Any]]] = {}
    filed = []
    for row in rows:
        found = _record(row)
        if found is None or (row.robot_id, found.person) not in lives:
            continue
        person = names.person(connection, row.robot_id, found.person, row.arrived_ns)
        number = {'series_id': names.series(connection, person, found.code)} if found.code else {
            'person_id': person}
        tables.setdefault(found.table, []).append({
            **found.row, **number, 'boot_id': row.boot_id, 'seq': row.seq,
            'arrived_ns': row.arrived_ns})
        filed.append(row.id)
    for name, made in tables.items():
        write(connection, METADATA.tables[name], made)
    if filed:
        connection.execute(delete(UNKNOWN).where(UNKNOWN.c.id.in_(filed)))
    return len(filed), rows[-1].id


def _record(row: Any) -> Sent | None:
    """Return the record in a row aside; None when it is truncated or invalid."""
    try:
        aside = json.loads(row.content)
        found = read({**aside['content'], 'seq': aside['seq'], 'utc_ns': aside['utc_ns']},
                     row.arrived_ns)
    except (ValueError, KeyError, TypeError):
        return None
    return found if isinstance(found, Sent) and found.person else None
