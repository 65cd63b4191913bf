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
``/voice``: signalling of calls between a browser and a robot; their media takes another path.

From the page come ``ring`` {robot, sdp} and ``hang_up``; to it go ``answer`` {sdp}, ``state``
{state} and ``ended`` {why}. One call of a robot at a time. A call ends with this connection.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from contextlib import suppress
import secrets
import time
from typing import Any
from typing import Final

from fastapi import WebSocket
from rt_robot_os.messages.texts.coded import codes_of
from rt_robot_os.messages.uplink.messages import decode
from rt_robot_os.messages.uplink.messages import encode
from rt_robot_os.messages.uplink.voice import ANSWER
from rt_robot_os.messages.uplink.voice import END
from rt_robot_os.messages.uplink.voice import RING
from rt_robot_os.messages.uplink.voice import SDP_CHARACTERS
from rt_robot_os.messages.uplink.voice import STATE
from rt_robot_os.messages.uplink.voice import VoiceMessage
from rt_robot_os.monitor.live.media_connection import may_view_cameras
from rt_robot_os.monitor.security.accounts import Revoked
from rt_robot_os.monitor.security.guard import Actor
from rt_robot_os.monitor.security.guard import Permission
from rt_robot_os.monitor.security.guard import websocket_actor
from rt_robot_os.monitor.services import Services
from starlette.websockets import WebSocketDisconnect

TEXT_MOST: Final = 80 << 10
CALLERS_MOST: Final = 50
#: Longest time until a robot answers a call.
ANSWER_S: Final = 20.0


class Caller:
    """
    A connection of a page, for one call at a time.

    :ivar robot: the called robot; empty for none.
    :ivar name: id of the call.
    """

    def __init__(self, websocket: WebSocket, actor: Actor) -> None:
        self.actor = actor
        self.robot = self.name = ''
        self.began_s = 0.0
        self.answered = False
        self.closing: tuple[int, str] | None = None
        self.wake = asyncio.Event()
        self._websocket = websocket
        self._out: list[str] = []

    def tell(self, kind: str, **content: Any) -> None:
        """Send the page a message, soon."""
        self._out.append(encode(kind, content))
        self.wake.set()

    def ended(self, why: str) -> None:
        """Send the page the reason why a call has ended or did not begin."""
        self.tell('ended', why=why, codes=codes_of({'why': why}, ('why',)))

    def close(self, code: int, text: str) -> None:
        """End the connection, soon."""
        self.closing = self.closing or (code, text)
        self.wake.set()

    async def send(self) -> None:
        """Send until it is closed."""
        while True:
            await self.wake.wait()
            self.wake.clear()
            while self._out:
                await self._websocket.send_text(self._out.pop(0))
            if self.closing is not None:
                await self._websocket.close(*self.closing)
                return


class Calls:
    """
    All calls; for the event loop alone.

    :param services: of the server.
    :ivar calls: number of calls so far.
    """

    def __init__(self, services: Services) -> None:
        self.calls = 0
        self._services = services
        self._by_robot: dict[str, Caller] = {}
        self._callers: set[Caller] = set()
        services.hub.on_voice.append(self._heard)
        services.hub.on_robot.append(self._robot_changed)
        services.accounts.on_revoked(self._revoked)

    async def serve(self, websocket: WebSocket) -> None:
        """Serve a connection until it ends."""
        actor = await websocket_actor(websocket, Permission.TALK)
        await websocket.accept()
        if len(self._callers) >= CALLERS_MOST:
            await websocket.close(1013, 'too many call already')
            return
        caller = Caller(websocket, actor)
        self._callers.add(caller)
        tasks = [asyncio.ensure_future(caller.send()),
                 asyncio.ensure_future(self._listen(websocket, caller))]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            self._callers.discard(caller)
            self._end(caller, '', 'the page has gone')
            for each in tasks:
                each.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    async def _listen(self, websocket: WebSocket, caller: Caller) -> None:
        with suppress(WebSocketDisconnect, RuntimeError):
            while True:
                text = await websocket.receive_text()
                try:
                    if len(text) > TEXT_MOST:
                        raise ValueError('too long')
                    self._take(caller, decode(text))
                except (KeyError, TypeError, ValueError):
                    caller.close(4400, 'this message is malformed or unknown')

    def _take(self, caller: Caller, message: Mapping[str, Any]) -> None:
        if message['kind'] == 'ring':
            self._ring(caller, str(message['robot'])[:64], message['sdp'])
        elif message['kind'] == 'hang_up':
            self._end(caller, '', 'hung up')
        else:
            raise ValueError('unknown')

    def _ring(self, caller: Caller, robot: str, sdp: object) -> None:
        if not isinstance(sdp, str) or not 0 < len(sdp) <= SDP_CHARACTERS or caller.robot:
            raise ValueError('no ring')
        hub, actor = self._services.hub, caller.actor
        state = hub.robots.get(robot)
        # A call transmits the voices of all people present: the user needs a grant for all
        # residents.
        if state is None or not may_view_cameras(actor.people, state):
            caller.ended('there is no such robot, or you may not call it')
            return
        other = self._by_robot.get(robot)
        if other is not None:
            caller.ended(f'{other.actor.name} talks with this robot now')
            return
        name = secrets.token_hex(8)
        if not hub.send(state, VoiceMessage(name, RING, sdp=sdp, by=actor.name)):
            caller.ended(f'{state.name} is not connected')
            return
        self.calls += 1
        caller.robot, caller.name, caller.answered = robot, name, False
        caller.began_s = time.monotonic()
        self._by_robot[robot] = caller
        self._show(robot, {'by': actor.name, 'since_ns': time.time_ns()})
        self._services.audit.note_soon(actor, 'voice.ring', robot)
        asyncio.get_running_loop().call_later(ANSWER_S, self._unanswered, caller, name)

    def _unanswered(self, caller: Caller, name: str) -> None:
        if caller.name == name and not caller.answered:
            self._end(caller, 'the robot does not answer', 'no answer')

    def _heard(self, robot: str, message: VoiceMessage) -> None:
        """Forward a signalling message of the robot."""
        caller = self._by_robot.get(robot)
        if caller is None or message.call != caller.name:
            return
        if message.do == ANSWER:
            caller.answered = True
            caller.tell('answer', sdp=message.sdp)
        elif message.do == STATE:
            caller.tell('state', state=message.state or '')
        elif message.do == END:
            self._end(caller, message.why or 'the call is over', 'ended by the robot',
                      tell_robot=False)

    def _robot_changed(self, robot: str, is_connected: bool) -> None:
        caller = self._by_robot.get(robot)
        if caller is not None and not is_connected:
            self._end(caller, 'the connection to the robot is lost', 'robot lost',
                      tell_robot=False)

    def _revoked(self, what: Revoked) -> None:
        for caller in list(self._callers):
            if caller.actor.session == what.id:
                caller.close(what.code, what.text)

    def _end(self, caller: Caller, why: str, noted: str, tell_robot: bool = True) -> None:
        """
        End a call; may be called twice.

        :param why: the reason for the page; empty when the page ended the call.
        """
        if not caller.robot:
            return
        robot, name = caller.robot, caller.name
        caller.robot = caller.name = ''
        if self._by_robot.get(robot) is caller:
            del self._by_robot[robot]
        state = self._services.hub.robots.get(robot)
        if state is not None and tell_robot:
            self._services.hub.send(state, VoiceMessage(name, END))
        if why:
            caller.ended(why)
        self._show(robot, None)
        self._services.audit.note_soon(caller.actor, 'voice.end', robot, why=noted,
                                       seconds=round(time.monotonic() - caller.began_s, 1))

    def _show(self, robot: str, call: dict[str, Any] | None) -> None:
        """Notify all clients that may see the robot of the user who talks with it."""
        state = self._services.hub.robots.get(robot)
        if state is not None:
            state.about = {**state.about, 'call': call}
            self._services.hub.tell_robot(state)
