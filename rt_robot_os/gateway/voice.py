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
Calls between a browser and the robot: rung by the server, carried by a process of its own.

The robot takes a call by itself, for who lies on the floor cannot; it says so first, so that
nobody is listened to unawares. The call ends with the connection to the server: no microphone
stays on that nobody could turn off.
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
from rt_robot_os.gateway.part import Part
from rt_robot_os.gateway.part import Ways
from rt_robot_os.linux.process import end_child
from rt_robot_os.linux.process import start_child
from rt_robot_os.messages.cdr import string_message

_CALL: Final = 'rt_robot_os.gateway.voice_call'
_SAY: Final = 'agent/say'
_SDP_MOST: Final = 64 << 10
_LINE_BYTES: Final = 1 << 20
_LONGEST_S: Final = 3600.0
_PATIENCE_S: Final = 2.0
_TIMES: Final = 'RT_ROBOT_OS_CALL_TIMES'


class _Running:
    """A call that goes on."""

    def __init__(self, name: str, by: str, process: subprocess.Popen[bytes]) -> None:
        self.name = name
        self.by = by
        self.process = process
        self.task: asyncio.Task[None] | None = None

    def say(self, content: Mapping[str, Any]) -> None:
        """Tell the process something."""
        pipe = self.process.stdin
        if pipe is not None:
            with suppress(OSError, ValueError):
                pipe.write(json.dumps(content).encode() + b'\n')
                pipe.flush()


class Voice(Part):
    """
    Calls; see the module.

    :ivar calls: that were taken.
    """

    kinds = frozenset({'voice'})

    def __init__(self, ways: Ways) -> None:
        super().__init__(ways)
        settings = ways.settings
        self.calls = 0
        self._running: _Running | None = None
        self._problem = 'none is set' if not (
            settings.microphone or settings.speaker) else lacking('voice', 'aiortc')

    def publishes(self) -> tuple[str, ...]:
        """Publish what the robot says."""
        return (_SAY,)

    def hello(self) -> Mapping[str, Any]:
        """Say whether it can be called."""
        return {} if self._problem else {'capabilities': ['talk']}

    def statistics(self) -> Mapping[str, Any]:
        """Return its counters."""
        return {'calls': self.calls, 'in_call': self._running is not None}

    def lost_server(self) -> None:
        """End a call: nobody could hang up."""
        self._end('the connection to the server is lost')

    def hear(self, message: Mapping[str, Any]) -> None:
        """
        Take a ring or the end of a call.

        :raises ValueError: it is neither.
        """
        name, do = message.get('call'), message.get('do')
        if not isinstance(name, str) or not 0 < len(name) <= 64:
            raise ValueError('a call without a name')
        if do == 'ring':
            self._ring(name, message)
        elif do == 'end':
            if self._running is not None and self._running.name == name:
                self._end('')
        else:
            raise ValueError(f'nobody knows {str(do)[:20]!r}')

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

    def _ring(self, name: str, message: Mapping[str, Any]) -> None:
        sdp = message.get('sdp')
        if not isinstance(sdp, str) or not 0 < len(sdp) <= _SDP_MOST:
            raise ValueError('a ring without an offer')
        if self._problem:
            self._tell(name, do='end', why=f'this robot cannot be called: {self._problem}')
        elif self._running is not None:
            self._tell(name, do='end', why='somebody else talks with this robot')
        else:
            self._begin(name, str(message.get('by', ''))[:64] or 'Somebody', sdp)

    def _begin(self, name: str, by: str, sdp: str) -> None:
        settings = self.ways.settings
        try:
            process = start_child(_CALL, os.getpid(), stdin=subprocess.PIPE,
                                  stdout=subprocess.PIPE)
        except OSError as error:
            self._tell(name, do='end', why=f'the call cannot be started: {error.strerror}')
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
        """Pass on what the process says, until it ends."""
        reader = asyncio.StreamReader(_LINE_BYTES)
        transport, _ = await asyncio.get_running_loop().connect_read_pipe(
            lambda: asyncio.StreamReaderProtocol(reader), running.process.stdout)
        why = 'the call has broken off'
        try:
            while line := await reader.readline():
                said = json.loads(line)
                if said['say'] == 'answer':
                    self._tell(running.name, do='answer', sdp=said['sdp'])
                elif said['say'] == 'state':
                    self._tell(running.name, do='state', state=said['state'])
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
                self._tell(running.name, do='end', why=why)
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
            self._tell(running.name, do='end', why=why)
        self._announce('The call is over. The microphone is off.')

    def _tell(self, name: str, **content: Any) -> None:
        self.ways.server.send('voice', {'call': name, **content})

    def _announce(self, text: str) -> None:
        with suppress(LinkError):  # a robot without a voice
            self.ways.robot.publish(_SAY, string_message(text))


def _note_time(said: Mapping[str, Any]) -> None:
    """Write when a sample of a made sound was spoken, for benchmarks/commands/measure_media.py."""
    path = os.environ.get(_TIMES)
    if path:
        with open(path, 'a') as file:
            file.write(json.dumps([said['utc_ns'], said['sample']]) + '\n')
