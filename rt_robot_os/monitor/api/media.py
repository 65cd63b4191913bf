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

"""Pictures, clips and sound of alarms: the list, and their bytes."""

from __future__ import annotations

from typing import Annotated
from typing import Any

from fastapi import APIRouter
from fastapi import Depends
from fastapi import Query
from fastapi.responses import FileResponse
from rt_robot_os.base.errors import StoreError
from rt_robot_os.monitor.api.answers import away
from rt_robot_os.monitor.api.answers import refusal
from rt_robot_os.monitor.api.answers import unknown
from rt_robot_os.monitor.api.models import ShownMedia
from rt_robot_os.monitor.live.media_connection import may_view_cameras
from rt_robot_os.monitor.live.media_connection import MediaHub
from rt_robot_os.monitor.live.robot_state import RobotState
from rt_robot_os.monitor.security.guard import Actor
from rt_robot_os.monitor.security.guard import allowed
from rt_robot_os.monitor.security.guard import Permission
from rt_robot_os.monitor.services import Services

#: The browser may show it, but not run, load or sniff anything in it, nor store a copy.
_HEADERS = {'Cache-Control': 'private, no-store', 'X-Content-Type-Options': 'nosniff',
            'Content-Security-Policy': "default-src 'none'; sandbox",
            'Cross-Origin-Resource-Policy': 'same-origin'}
_SUFFIXES = {'image/jpeg': 'jpg', 'video/x-msvideo': 'avi', 'audio/wav': 'wav'}
_SHOWN = ('id', 'robot', 'alarm', 'subject', 'kind', 'size', 'width', 'height', 't_ns')


def router(services: Services) -> APIRouter:
    """Return the endpoints."""
    found = APIRouter(prefix='/api/media', tags=['media'])
    hub: MediaHub = services.media

    def seen(actor: Actor, row: dict[str, Any] | None) -> bool:
        return row is not None and may_see(
            actor, services.hub.robots.get(row['robot']), row['subject'])

    @found.get('', response_model=list[ShownMedia])
    def media(robot: str | None = None, alarm: str | None = None,
              limit: Annotated[int, Query(ge=1, le=500)] = 100,
              actor: Actor = Depends(allowed(Permission.CAMERA))) -> list[dict[str, Any]]:
        """Return the list, the newest first; ``here``: the bytes have been received."""
        try:
            rows = services.store.media_list(robot, alarm, limit)
        except StoreError as error:
            raise away(error) from error
        return [{**{key: row[key] for key in _SHOWN},
                 'here': hub.files.has(row['robot'], row['sha256'])}
                for row in rows if seen(actor, row)]

    @found.get('/{number}', response_class=FileResponse)
    def one(number: int, actor: Actor = Depends(allowed(Permission.CAMERA))) -> FileResponse:
        """Return the bytes of one, also ranges; recorded in the audit."""
        try:
            row = services.store.media(number) if 0 <= number < 1 << 62 else None
        except StoreError as error:
            raise away(error) from error
        if row is None or not seen(actor, row):
            raise unknown('picture or clip')
        file = hub.files.find(row['robot'], row['sha256'])
        if file is None or file[1] not in _SUFFIXES:
            raise refusal(409, 'the robot has told of it, and it is not here',
                          'it is on its way while the robot is connected; it may also have made '
                          'room for newer ones')
        services.audit.note(actor, 'media.read', f"{row['robot']}/{row['alarm']}", id=number,
                            subject=row['subject'])
        return FileResponse(file[0], media_type=file[1], headers=_HEADERS,
                            filename=f'{row["kind"] or "media"}-{number}.{_SUFFIXES[file[1]]}',
                            content_disposition_type='inline')

    return found


def may_see(actor: Actor, robot: RobotState | None, subject: str) -> bool:
    """
    Return whether a user may see a picture.

    :param subject: the person that its alarm is about, whom it shows; a picture of another alarm,
        such as of smoke, may show any resident.
    """
    if actor.people is None:
        return True
    if robot is None or robot.people is None:
        return False
    if subject in robot.people:
        return subject in actor.people
    return may_view_cameras(actor.people, robot)
