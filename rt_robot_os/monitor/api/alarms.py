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

"""Alarms: the open ones, those of the past, and notes about them."""

from __future__ import annotations

from typing import Annotated
from typing import Any

from fastapi import APIRouter
from fastapi import Depends
from fastapi import Path
from fastapi import Query
from pydantic import BaseModel
from pydantic import Field
from rt_robot_os.base.errors import StoreError
from rt_robot_os.monitor.api.answers import away
from rt_robot_os.monitor.api.answers import unknown
from rt_robot_os.monitor.api.models import AlarmDetails
from rt_robot_os.monitor.api.models import CodedAlarm
from rt_robot_os.monitor.api.models import Done
from rt_robot_os.monitor.api.models import NoteAdded
from rt_robot_os.monitor.security.guard import Actor
from rt_robot_os.monitor.security.guard import allowed
from rt_robot_os.monitor.security.guard import Permission
from rt_robot_os.monitor.services import Services

TIME_MOST = (1 << 63) - 1
#: How long the author of a note can withdraw it.
WITHDRAW_S = 60.0
Time = Annotated[int, Query(ge=0, le=TIME_MOST)]


class NoteRequest(BaseModel):
    """A note of a user."""

    text: str = Field(min_length=1, max_length=1000)


def router(services: Services) -> APIRouter:
    """Return the endpoints."""
    found = APIRouter(prefix='/api/alarms', tags=['alarms'])
    hub = services.hub

    def seen(actor: Actor, alarm: dict[str, Any] | None) -> dict[str, Any] | None:
        robot = hub.robots.get(alarm['robot']) if alarm else None
        if alarm is None or robot is None:
            return None
        return robot.alarm_shown(alarm, hub.rights_of(actor))

    @found.get('', response_model=list[CodedAlarm], response_model_exclude_unset=True)
    def alarms(robot: str | None = None, is_open: Annotated[bool | None, Query(alias='open')]
               = None, since_ns: Time = 0, limit: Annotated[int, Query(ge=1, le=1000)] = 200,
               actor: Actor = Depends(allowed(Permission.SEE))) -> list[dict[str, Any]]:
        """Return alarms, the most recently changed first."""
        try:
            rows = services.store.alarms(people=actor.people, robot=robot, is_open=is_open,
                                         since_ns=since_ns, limit=limit)
        except StoreError as error:
            raise away(error) from error
        return [each for each in (seen(actor, row) for row in rows) if each is not None]

    @found.get('/{robot}/{alarm:path}',
               response_model=AlarmDetails, response_model_exclude_unset=True)
    def one_alarm(robot: str, alarm: str, actor: Actor = Depends(allowed(Permission.SEE))
                  ) -> dict[str, Any]:
        """Return an alarm with its events, notes and media."""
        try:
            shown = seen(actor, services.store.alarm(robot, alarm))
        except StoreError as error:
            raise away(error) from error
        if shown is None:
            raise unknown('alarm')
        return shown

    @found.post('/{robot}/{alarm:path}/notes', status_code=201, response_model=NoteAdded)
    def note(robot: str, alarm: str, note: NoteRequest,
             actor: Actor = Depends(allowed(Permission.ACKNOWLEDGE))) -> dict[str, Any]:
        """Add a note about an alarm; it is stored when this answers with its ``id``."""
        try:
            if seen(actor, services.store.alarm(robot, alarm)) is None:
                raise unknown('alarm')
            number = services.store.add_note(robot, alarm, actor.name, note.text)
        except StoreError as error:
            raise away(error) from error
        if number is None:
            raise unknown('alarm')
        services.audit.note(actor, 'alarm.note', f'{robot}/{alarm}', text=note.text)
        return {'ok': True, 'id': number}

    @found.delete('/{robot}/{alarm:path}/notes/{note}', response_model=Done)
    def withdraw(robot: str, alarm: str, note: Annotated[int, Path(ge=0, le=TIME_MOST)],
                 actor: Actor = Depends(allowed(Permission.ACKNOWLEDGE))) -> dict[str, bool]:
        """Withdraw one's own note within a minute; the audit records this."""
        try:
            if seen(actor, services.store.alarm(robot, alarm)) is None:
                raise unknown('alarm')
            text = services.store.withdraw_note(note, robot, alarm, actor.name, WITHDRAW_S)
        except StoreError as error:
            raise away(error) from error
        if text is None:
            raise unknown('note of yours that is less than a minute old')
        services.audit.note(actor, 'alarm.note_withdrawn', f'{robot}/{alarm}', text=text)
        return {'ok': True}

    return found
