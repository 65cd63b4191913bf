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
``/drive?robot=ID``: the connections of drivers.

From the page come ``take`` {over}, ``give``, ``drive`` {seq, beat, held_ms, grip, linear_m_s,
angular_rad_s} and ``alive``; to it go ``seat`` {state: free, yours or other, by, connected,
limits}, ``beat`` (as the robot sends it, to the one who may drive), ``lost`` {by, why} and
``refused`` {why, by}. A page that sends nothing for three seconds is treated as gone.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import Any
from typing import Final

from fastapi import WebSocket
from rt_robot_os.messages.uplink.driving import DriveBeat
from rt_robot_os.messages.uplink.greeting import DriveLimits
from rt_robot_os.messages.uplink.messages import decode
from rt_robot_os.monitor.live.send_queue import SendQueue
from rt_robot_os.monitor.live.teleop_session import HeldByAnotherError
from rt_robot_os.monitor.live.teleop_session import TeleopClient
from rt_robot_os.monitor.live.teleop_session import TeleopSession
from rt_robot_os.monitor.security.accounts import Revoked
from rt_robot_os.monitor.security.guard import Actor
from rt_robot_os.monitor.security.guard import Permission
from rt_robot_os.monitor.security.guard import websocket_actor
from rt_robot_os.monitor.services import Services
from starlette.websockets import WebSocketDisconnect

SILENT_S: Final = 3.0
CLIENTS_MOST: Final = 50
MESSAGE_CHARACTERS: Final = 1000
RATE_MOST_HZ: Final = 200
#: Period at which the driver's session is marked as used.
TOUCH_S: Final = 60.0
#: Codes of the end of a connection.
UNKNOWN: Final = 4404
SILENT: Final = 4408
TOO_MUCH: Final = 4429
BAD: Final = 4400
_CLOSE_S: Final = 1.0


class TeleopSessions:
    """
    The tele-operation of all robots, by the connections of pages.

    :param services: of the server.
    """

    def __init__(self, services: Services) -> None:
        self._services = services
        self._sessions: dict[str, TeleopSession] = {}
        self._later: set[asyncio.Future[Any]] = set()
        services.hub.on_beat.append(self._beat)
        services.hub.on_robot.append(self._robot)
        services.accounts.on_revoked(self._revoked)

    async def serve(self, websocket: WebSocket, robot: str) -> None:
        """Serve a connection until it ends."""
        actor = await websocket_actor(websocket, Permission.DRIVE)
        await websocket.accept()
        session = self._session_of(actor, robot)
        if session is None or len(session.clients) >= CLIENTS_MOST:
            await websocket.close(UNKNOWN if session is None else TOO_MUCH)
            return
        queue = SendQueue(websocket)
        client = TeleopClient(actor.name, actor.session, queue)
        session.enter(client)
        tasks = [asyncio.ensure_future(queue.run()),
                 asyncio.ensure_future(self._listen(websocket, actor, session, client))]
        why = 'connection lost'
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            if tasks[1].done() and not tasks[1].cancelled() and tasks[1].exception() is None:
                why = str(tasks[1].result())
        finally:
            # First of all, so that the robot stops whatever fails afterwards.
            had = session.leave(client, client.ended or why) or bool(client.ended)
            if not session.clients:
                self._sessions.pop(robot, None)
            self._note_end(actor, session, client, had, client.ended or why)
            await asyncio.wait(tasks[:1], timeout=_CLOSE_S if queue.closing else 0.0)
            for each in tasks:
                each.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    def statistics(self) -> dict[str, Any]:
        """Return the driver of each robot, and counters of refused commands."""
        return {robot: {'driver': session.lease.holder.name if session.lease.holder else '',
                        'seats': len(session.clients), 'refused': session.refused,
                        'lost': session.lost}
                for robot, session in self._sessions.items()}

    # ---- of one connection -------------------------------------------------------------------

    async def _listen(self, websocket: WebSocket, actor: Actor, session: TeleopSession,
                      client: TeleopClient) -> str:
        """Process requests of the page until its connection ends; return why it ended."""
        loop = asyncio.get_running_loop()
        window_s, count, touched_s = loop.time(), 0, 0.0
        while True:
            try:
                text = await asyncio.wait_for(websocket.receive_text(), SILENT_S)
            except asyncio.TimeoutError:
                return self._close(client, SILENT, 'nothing heard')
            except (WebSocketDisconnect, RuntimeError, KeyError):
                return 'window closed'
            count += 1
            if loop.time() - window_s >= 1.0:
                window_s, count = loop.time(), 0
            if count > RATE_MOST_HZ:
                return self._close(client, TOO_MUCH, 'too many messages')
            try:
                message = decode(text[:MESSAGE_CHARACTERS])
            except ValueError:
                return self._close(client, BAD, 'not a valid message')
            await self._do(actor, session, client, message)
            if client.driven and loop.time() - touched_s > TOUCH_S:
                touched_s = loop.time()
                self._touch_soon(actor.session)

    @staticmethod
    def _close(client: TeleopClient, code: int, why: str) -> str:
        client.queue.close(code, why)
        return why

    async def _do(self, actor: Actor, session: TeleopSession, client: TeleopClient,
                  message: Mapping[str, Any]) -> None:
        kind = message['kind']
        if kind == 'drive':
            session.drive(client, message)
        elif kind == 'take':
            await self._take(actor, session, client, message.get('over') is True)
        elif kind == 'give':
            had = session.give(client, 'given back')
            self._note_end(actor, session, client, had, 'given back')

    async def _take(self, actor: Actor, session: TeleopSession, client: TeleopClient, over: bool
                    ) -> None:
        if not session.connected or not session.limits.linear_m_s:
            client.tell('refused', why='cannot' if session.connected else 'absent', by='')
            return
        is_theirs = session.lease.holder is client
        try:
            former = session.take(client, over)
        except HeldByAnotherError:
            holder = session.lease.holder
            client.tell('refused', why='held', by=holder.name if holder is not None else '')
            return
        if not is_theirs:
            details = {} if former is None else {'from': former.name, 'commands': former.driven}
            action = 'drive.take_over' if former is not None else 'drive.take'
            self._services.audit.note_soon(actor, action, session.robot, **details)

    def _note_end(self, actor: Actor, session: TeleopSession, client: TeleopClient, had: bool,
                  why: str) -> None:
        """Write to the audit that a driver no longer drives."""
        if had:
            self._services.audit.note_soon(actor, 'drive.end', session.robot, why=why,
                                           commands=client.driven)

    def _touch_soon(self, session: str) -> None:
        """Mark a session as used without waiting for the disk, which must not delay a stop."""
        task = asyncio.ensure_future(asyncio.to_thread(self._touch, session))
        self._later.add(task)
        task.add_done_callback(self._later.discard)

    def _touch(self, session: str) -> None:
        sessions = self._services.accounts.sessions
        for found in sessions.get([session]).values():
            sessions.touch(found)

    # ---- of robots and sessions --------------------------------------------------------------

    def _session_of(self, actor: Actor, robot: str) -> TeleopSession | None:
        hub = self._services.hub
        if not hub.may_see_robot(actor, robot):
            return None
        session = self._sessions.get(robot)
        if session is None:
            session = self._sessions[robot] = TeleopSession(robot, hub.drive)
            self._look(session)
        return session

    def _look(self, session: TeleopSession) -> None:
        found = self._services.hub.robots.get(session.robot)
        if found is None:
            session.robot_is(False, DriveLimits())
            return
        session.robot_is(found.connected, DriveLimits.from_json(found.about.get('limits', {})))

    def _beat(self, robot: str, message: DriveBeat) -> None:
        session = self._sessions.get(robot)
        if session is not None:
            session.beat(message)

    def _robot(self, robot: str, connected: bool) -> None:
        session = self._sessions.get(robot)
        if session is not None:
            self._look(session)

    def _revoked(self, revoked: Revoked) -> None:
        """End the connections of an account's session immediately."""
        if revoked.kind != 'session':
            return
        for session in list(self._sessions.values()):
            for client in [each for each in session.clients if each.session == revoked.id]:
                if session.give(client, 'session ended'):
                    client.ended = 'session ended'
                client.queue.close(revoked.code, revoked.text)
