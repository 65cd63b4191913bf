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

"""The endpoints of robots: ``/robot/state`` for messages, ``/robot/media`` for media."""

from __future__ import annotations

from fastapi import APIRouter
from fastapi import WebSocket
from rt_robot_os.monitor.live.media_connection import MediaHub
from rt_robot_os.monitor.live.media_connection import serve_robot
from rt_robot_os.monitor.live.robot_connection import RobotConnection
from rt_robot_os.monitor.security.guard import robot_of
from rt_robot_os.monitor.services import Services


def router(services: Services) -> APIRouter:
    """Return the endpoints."""
    found = APIRouter()
    media: MediaHub = services.media
    services.accounts.on_revoked(media.revoke)

    @found.websocket('/robot/state')
    async def robot_state(websocket: WebSocket) -> None:
        robot = await robot_of(websocket)
        await websocket.accept()
        hub = services.hub
        if hub.connected >= services.settings.robots and not hub.is_connected(robot.id):
            hub.counts['robots_refused'] += 1
            await websocket.close(1013, 'as many robots as there may be are connected')
            return
        await RobotConnection(services, websocket, hub.get_or_create(robot.id, robot.name)).run()

    @found.websocket('/robot/media')
    async def robot_media(websocket: WebSocket) -> None:
        robot = await robot_of(websocket)
        await websocket.accept()
        await serve_robot(websocket, robot.id, media)

    return found
