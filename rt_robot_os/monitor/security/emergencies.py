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
Emergency access, with a reason, to the health data of a person that the user may not see.

Known as break-glass: it needs no approval, since no approver may be available. It expires, is
recorded in the audit, and admins see it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from typing import Final

from rt_robot_os.monitor.security.tables import emergencies
from rt_robot_os.monitor.security.tables import users
from rt_robot_os.monitor.security.tokens import new_id
from rt_robot_os.monitor.security.users import AccountError
from rt_robot_os.monitor.store.engine import reading
from rt_robot_os.monitor.store.engine import writing
from sqlalchemy import Engine
from sqlalchemy import select

SECOND_NS: Final = 1_000_000_000
LASTS_S: Final = 1800
SHORTEST_REASON: Final = 10
LONGEST_REASON: Final = 500


class EmergencyAccess:
    """The table of emergencies; thread-safe."""

    def __init__(self, engine: Engine, now_ns: Callable[[], int]) -> None:
        self._engine = engine
        self._now_ns = now_ns

    def begin(self, user: str, session: str, person: str, reason: str) -> int:
        """
        Begin an emergency for this session.

        :param person: a name, or ``*`` when it is not known.
        :return: when it expires.
        :raises AccountError: the reason is not valid.
        """
        reason = ' '.join(reason.split())
        if not SHORTEST_REASON <= len(reason) <= LONGEST_REASON:
            raise AccountError('the reason', f'{SHORTEST_REASON} to {LONGEST_REASON} characters: '
                               'admins read it')
        if not 1 <= len(person) <= 128 or not person.isprintable():
            raise AccountError('the person', 'a name, or * when it is not known')
        now = self._now_ns()
        ends = now + LASTS_S * SECOND_NS
        with writing(self._engine) as connection:
            connection.execute(emergencies.update().where(
                emergencies.c.session == session, emergencies.c.person == person,
                emergencies.c.ends_ns > now).values(ends_ns=now))
            connection.execute(emergencies.insert().values(
                id=new_id(), user=user, session=session, person=person, reason=reason,
                begins_ns=now, ends_ns=ends))
        return ends

    def end(self, session: str) -> int:
        """End the emergencies of a session; return their number."""
        now = self._now_ns()
        with writing(self._engine) as connection:
            done = connection.execute(emergencies.update().where(
                emergencies.c.session == session, emergencies.c.ends_ns > now)
                .values(ends_ns=now))
            return int(done.rowcount)

    def all(self, limit: int = 200) -> list[dict[str, Any]]:  # noqa: A003
        """Return the newest emergencies, as admins see them."""
        now = self._now_ns()
        with reading(self._engine) as connection:
            rows = connection.execute(
                select(emergencies, users.c.name).join(users, users.c.id == emergencies.c.user)
                .order_by(emergencies.c.begins_ns.desc()).limit(limit)).all()
        return [{'id': row.id, 'user': row.user, 'name': row.name, 'person': row.person,
                 'reason': row.reason, 'begins_ns': row.begins_ns, 'ends_ns': row.ends_ns,
                 'is_open': row.ends_ns > now} for row in rows]
