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

"""The endpoints of pages: ``/live`` for states, alarms and signals, ``/camera`` for pictures."""

from __future__ import annotations

from typing import Final

from fastapi import APIRouter
from fastapi import WebSocket
from rt_robot_os.monitor.live.client_connection import ClientConnection
from rt_robot_os.monitor.live.media_connection import BrowserMedia
from rt_robot_os.monitor.live.media_connection import may_view_cameras
from rt_robot_os.monitor.live.media_connection import MediaHub
from rt_robot_os.monitor.security.accounts import Revoked
from rt_robot_os.monitor.security.guard import Permission
from rt_robot_os.monitor.security.guard import websocket_actor
from rt_robot_os.monitor.services import Services

#: Most pages that watch cameras.
VIEWERS_MOST: Final = 200


def router(services: Services) -> APIRouter:
    """Return the endpoints."""
    found = APIRouter()
    media: MediaHub = services.media
    viewers: set[BrowserMedia] = set()

    def revoked(what: Revoked) -> None:
        for each in list(viewers):
            if each.session == what.id:
                each.close(what.code, what.text)

    services.accounts.on_revoked(revoked)

    @found.websocket('/live')
    async def live(websocket: WebSocket) -> None:
        actor = await websocket_actor(websocket, Permission.SEE)
        await websocket.accept()
        if len(services.hub.clients) >= services.settings.clients:
            services.hub.counts['refused'] += 1
            await websocket.close(1013, 'as many browsers as there may be have live data')
            return
        await ClientConnection(services, websocket, actor).run()

    @found.websocket('/camera')
    async def camera(websocket: WebSocket) -> None:
        actor = await websocket_actor(websocket, Permission.CAMERA)
        await websocket.accept()
        if len(viewers) >= VIEWERS_MOST:
            await websocket.close(1013, 'too many browsers look at cameras')
            return
        viewer = BrowserMedia(
            websocket, media.gallery, actor.session,
            lambda robot: may_view_cameras(actor.people, services.hub.robots.get(robot)),
            lambda key: services.audit.note(actor, 'camera.look', f'{key[0]}/{key[1]}'))
        viewers.add(viewer)
        try:
            await viewer.serve()
        finally:
            viewers.discard(viewer)

    return found
