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
Calls between a browser and the robot: signalled by the server, run in a separate process.

The robot answers a call by itself, since a person lying on the floor cannot; it announces the call
first, so that people know that the microphone is on. The call ends with the connection to the
server, because the microphone could no longer be turned off.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from contextlib import suppress
import json
import os
import subprocess
from typing import Any
from typing import Final

from rt_robot_os.base.errors import LinkError
from rt_robot_os.base.needs import lacking
from rt_robot_os.gateway.part import GatewayContext
from rt_robot_os.gateway.part import Greeting
from rt_robot_os.gateway.part import Part
from rt_robot_os.linux.process import end_child
from rt_robot_os.linux.process import start_child
from rt_robot_os.messages.cdr import string_message
from rt_robot_os.messages.uplink.messages import UplinkMessage
from rt_robot_os.messages.uplink.voice import ANSWER
from rt_robot_os.messages.uplink.voice import END
from rt_robot_os.messages.uplink.voice import RING
from rt_robot_os.messages.uplink.voice import STATE
from rt_robot_os.messages.uplink.voice import VoiceMessage

_CALL: Final = 'rt_robot_os.gateway.voice_call'
_SAY: Final = 'agent/say'
_LINE_BYTES: Final = 1 << 20
_LONGEST_S: Final = 3600.0
_PATIENCE_S: Final = 2.0
_TIMES: Final = 'RT_ROBOT_OS_CALL_TIMES'


class _Running:
    """A call in progress."""

    def __init__(self, name: str, by: str, process: subprocess.Popen[bytes]) -> None:
        self.name = name
        self.by = by
        self.process = process
        self.task: asyncio.Task[None] | None = None

    def say(self, content: Mapping[str, Any]) -> None:
        """Send the process a message."""
        pipe = self.process.stdin
        if pipe is not None:
            with suppress(OSError, ValueError):
                pipe.write(json.dumps(content).encode() + b'\n')
                pipe.flush()


class Voice(Part):
    """
    Calls; see the module.

    :ivar calls: accepted calls.
    """

    receives = (VoiceMessage,)

    def __init__(self, context: GatewayContext) -> None:
        super().__init__(context)
        settings = context.settings
        self.calls = 0
        self._running: _Running | None = None
        self._problem = 'none is set' if not (
            settings.microphone or settings.speaker) else lacking('voice', 'aiortc')

    def publishes(self) -> tuple[str, ...]:
        """Publish the speech of the robot."""
        return (_SAY,)

    def hello(self) -> Greeting:
        """Announce whether it can be called."""
        return Greeting() if self._problem else Greeting(('talk',))

    def statistics(self) -> Mapping[str, Any]:
        """Return its counters."""
        return {'calls': self.calls, 'in_call': self._running is not None}

    def lost_server(self) -> None:
        """End a call: it could not be hung up any more."""
        self._end('the connection to the server is lost')

    def receive(self, message: UplinkMessage) -> None:
        """
        Receive a ring or the end of a call.

        :raises ValueError: it is neither.
        """
        if not isinstance(message, VoiceMessage):
            return
        if message.do == RING:
            self._ring(message)
        elif message.do == END:
            if self._running is not None and self._running.name == message.call:
                self._end('')
        else:
            raise ValueError(f'do = {message.do[:20]!r} is not known')

    async def run(self) -> None:
        """End the call when the gateway ends."""
        try:
            await asyncio.Event().wait()
        finally:
            running = self._running
            if running is not None:
                self._end('the robot ends')
                end_child(running.process, _PATIENCE_S)

    # ---- one call ----------------------------------------------------------------------------

    def _ring(self, message: VoiceMessage) -> None:
        if self._problem:
            self._send_end(message.call, f'this robot cannot be called: {self._problem}')
        elif self._running is not None:
            self._send_end(message.call, 'another caller talks with this robot')
        else:
            self._begin(message.call, message.by or 'Somebody', message.sdp or '')

    def _begin(self, name: str, by: str, sdp: str) -> None:
        settings = self.context.settings
        try:
            process = start_child(_CALL, os.getpid(), stdin=subprocess.PIPE,
                                  stdout=subprocess.PIPE)
        except OSError as error:
            self._send_end(name, f'the call cannot be started: {error.strerror}')
            return
        self.calls += 1
        running = self._running = _Running(name, by, process)
        self._announce(f'{by} calls. The microphone is on.')
        running.say({'sdp': sdp, 'microphone': settings.microphone, 'speaker': settings.speaker,
                     'duck_db': settings.duck_db})
        running.task = asyncio.ensure_future(self._follow(running))
        asyncio.get_running_loop().call_later(_LONGEST_S, self._too_long, running)

    def _too_long(self, running: _Running) -> None:
        if self._running is running:
            self._end('it was a very long call: ring again')

    async def _follow(self, running: _Running) -> None:
        """Forward the messages of the process until it ends."""
        reader = asyncio.StreamReader(_LINE_BYTES)
        transport, _ = await asyncio.get_running_loop().connect_read_pipe(
            lambda: asyncio.StreamReaderProtocol(reader), running.process.stdout)
        why = 'the call has broken off'
        try:
            while line := await reader.readline():
                said = json.loads(line)
                if said['say'] == 'answer':
                    self._send(VoiceMessage(running.name, ANSWER, sdp=said['sdp']))
                elif said['say'] == 'state':
                    self._send(VoiceMessage(running.name, STATE, state=said['state']))
                elif said['say'] == 'microphone':
                    _note_time(said)
                elif said['say'] == 'end':
                    why = said['why']
        except (ValueError, KeyError, TypeError):
            pass
        finally:
            transport.close()
            if self._running is running:
                self._running = None
                self._send_end(running.name, why)
                self._announce('The call is over. The microphone is off.')
            await asyncio.to_thread(end_child, running.process, _PATIENCE_S)

    def _end(self, why: str) -> None:
        running = self._running
        if running is None:
            return
        self._running = None
        running.say({'do': 'end'})
        if running.process.stdin is not None:
            with suppress(OSError):
                running.process.stdin.close()
        if why:
            self._send_end(running.name, why)
        self._announce('The call is over. The microphone is off.')

    def _send(self, message: VoiceMessage) -> None:
        self.context.server.send(message)

    def _send_end(self, name: str, why: str) -> None:
        self._send(VoiceMessage(name, END, why=why))

    def _announce(self, text: str) -> None:
        with suppress(LinkError):  # a robot without a voice
            self.context.robot.publish(_SAY, string_message(text))


def _note_time(said: Mapping[str, Any]) -> None:
    """Write when generated sound was played, for benchmarks/commands/measure_media.py."""
    path = os.environ.get(_TIMES)
    if path:
        with open(path, 'a') as file:
            file.write(json.dumps([said['utc_ns'], said['sample']]) + '\n')
