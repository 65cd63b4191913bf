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
``/drive?robot=ID``: the connection of somebody who drives.

From the page come ``take`` {over}, ``give``, ``drive`` {seq, beat, held_ms, grip, linear_m_s,
angular_rad_s} and ``alive``; to it go ``seat`` {state: free, yours or other, by, connected,
limits}, ``beat`` (as the robot sends it, to the one who may drive), ``lost`` {by, why} and
``refused`` {why, by}. A page that says nothing for three seconds has gone.
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
from rt_robot_os.monitor.live.outlet import Outlet
from rt_robot_os.monitor.live.teleop_session import Cab
from rt_robot_os.monitor.live.teleop_session import HeldByAnotherError
from rt_robot_os.monitor.live.teleop_session import Seat
from rt_robot_os.monitor.security.accounts import Revoked
from rt_robot_os.monitor.security.guard import Actor
from rt_robot_os.monitor.security.guard import Permission
from rt_robot_os.monitor.security.guard import websocket_actor
from rt_robot_os.monitor.services import Services
from starlette.websockets import WebSocketDisconnect

SILENT_S: Final = 3.0
SEATS_MOST: Final = 50
MESSAGE_CHARACTERS: Final = 1000
RATE_MOST_HZ: Final = 200
#: Whoever drives uses the session: so often that is noted.
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
        self._cabs: dict[str, Cab] = {}
        self._later: set[asyncio.Future[Any]] = set()
        services.hub.on_beat.append(self._beat)
        services.hub.on_robot.append(self._robot)
        services.accounts.on_revoked(self._revoked)

    async def serve(self, websocket: WebSocket, robot: str) -> None:
        """Serve a connection until it ends."""
        actor = await websocket_actor(websocket, Permission.DRIVE)
        await websocket.accept()
        cab = self._cab_of(actor, robot)
        if cab is None or len(cab.seats) >= SEATS_MOST:
            await websocket.close(UNKNOWN if cab is None else TOO_MUCH)
            return
        outlet = Outlet(websocket)
        seat = Seat(actor.name, actor.session, outlet)
        cab.enter(seat)
        tasks = [asyncio.ensure_future(outlet.run()),
                 asyncio.ensure_future(self._listen(websocket, actor, cab, seat))]
        why = 'connection lost'
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            if tasks[1].done() and not tasks[1].cancelled() and tasks[1].exception() is None:
                why = str(tasks[1].result())
        finally:
            # First of all: whatever else fails, it stands.
            had = cab.leave(seat, seat.ended or why) or bool(seat.ended)
            if not cab.seats:
                self._cabs.pop(robot, None)
            self._note_end(actor, cab, seat, had, seat.ended or why)
            await asyncio.wait(tasks[:1], timeout=_CLOSE_S if outlet.closing else 0.0)
            for each in tasks:
                each.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    def statistics(self) -> dict[str, Any]:
        """Return who drives which robot, and what was refused."""
        return {robot: {'driver': cab.lease.holder.name if cab.lease.holder else '',
                        'seats': len(cab.seats), 'refused': cab.refused, 'lost': cab.lost}
                for robot, cab in self._cabs.items()}

    # ---- of one connection -------------------------------------------------------------------

    async def _listen(self, websocket: WebSocket, actor: Actor, cab: Cab, seat: Seat) -> str:
        """Do what it says; return why it ended."""
        loop = asyncio.get_running_loop()
        window_s, count, touched_s = loop.time(), 0, 0.0
        while True:
            try:
                text = await asyncio.wait_for(websocket.receive_text(), SILENT_S)
            except asyncio.TimeoutError:
                return self._close(seat, SILENT, 'nothing heard')
            except (WebSocketDisconnect, RuntimeError, KeyError):
                return 'window closed'
            count += 1
            if loop.time() - window_s >= 1.0:
                window_s, count = loop.time(), 0
            if count > RATE_MOST_HZ:
                return self._close(seat, TOO_MUCH, 'too many messages')
            try:
                message = decode(text[:MESSAGE_CHARACTERS])
            except ValueError:
                return self._close(seat, BAD, 'not a message')
            await self._do(actor, cab, seat, message)
            if seat.driven and loop.time() - touched_s > TOUCH_S:
                touched_s = loop.time()
                self._touch_soon(actor.session)

    @staticmethod
    def _close(seat: Seat, code: int, why: str) -> str:
        seat.outlet.close(code, why)
        return why

    async def _do(self, actor: Actor, cab: Cab, seat: Seat, message: Mapping[str, Any]) -> None:
        kind = message['kind']
        if kind == 'drive':
            cab.drive(seat, message)
        elif kind == 'take':
            await self._take(actor, cab, seat, message.get('over') is True)
        elif kind == 'give':
            self._note_end(actor, cab, seat, cab.give(seat, 'given back'), 'given back')

    async def _take(self, actor: Actor, cab: Cab, seat: Seat, over: bool) -> None:
        if not cab.connected or not cab.limits.linear_m_s:
            seat.tell('refused', why='cannot' if cab.connected else 'absent', by='')
            return
        is_theirs = cab.lease.holder is seat
        try:
            former = cab.take(seat, over)
        except HeldByAnotherError:
            holder = cab.lease.holder
            seat.tell('refused', why='held', by=holder.name if holder is not None else '')
            return
        if not is_theirs:
            details = {} if former is None else {'from': former.name, 'commands': former.driven}
            action = 'drive.take_over' if former is not None else 'drive.take'
            self._services.audit.note_soon(actor, action, cab.robot, **details)

    def _note_end(self, actor: Actor, cab: Cab, seat: Seat, had: bool, why: str) -> None:
        """Note in the audit that somebody no longer drives."""
        if had:
            self._services.audit.note_soon(actor, 'drive.end', cab.robot, why=why,
                                           commands=seat.driven)

    def _touch_soon(self, session: str) -> None:
        """Note that a session is used, without waiting for the disk: a stop comes first."""
        task = asyncio.ensure_future(asyncio.to_thread(self._touch, session))
        self._later.add(task)
        task.add_done_callback(self._later.discard)

    def _touch(self, session: str) -> None:
        sessions = self._services.accounts.sessions
        for found in sessions.get([session]).values():
            sessions.touch(found)

    # ---- of robots and sessions --------------------------------------------------------------

    def _cab_of(self, actor: Actor, robot: str) -> Cab | None:
        hub = self._services.hub
        if not hub.may_see_robot(actor, robot):
            return None
        cab = self._cabs.get(robot)
        if cab is None:
            cab = self._cabs[robot] = Cab(robot, hub.drive)
            self._look(cab)
        return cab

    def _look(self, cab: Cab) -> None:
        found = self._services.hub.robots.get(cab.robot)
        if found is None:
            cab.robot_is(False, DriveLimits())
            return
        cab.robot_is(found.connected, DriveLimits.from_json(found.about.get('limits', {})))

    def _beat(self, robot: str, message: DriveBeat) -> None:
        cab = self._cabs.get(robot)
        if cab is not None:
            cab.beat(message)

    def _robot(self, robot: str, connected: bool) -> None:
        cab = self._cabs.get(robot)
        if cab is not None:
            self._look(cab)

    def _revoked(self, revoked: Revoked) -> None:
        """End what a session holds, at once."""
        if revoked.kind != 'session':
            return
        for cab in list(self._cabs.values()):
            for seat in [each for each in cab.seats if each.session == revoked.id]:
                if cab.give(seat, 'session ended'):
                    seat.ended = 'session ended'
                seat.outlet.close(revoked.code, revoked.text)
