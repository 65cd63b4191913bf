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
One call of the robot, in a separate process: WebRTC by aiortc, a microphone and a speaker.

The gateway starts it for a call and ends it with the call, so that neither its libraries nor its
work delay a command. It reads the offer and the end as lines of JSON, and writes the answer,
states, and the reason of the end.
"""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from contextlib import suppress
from fractions import Fraction
import json
import sys
from typing import Any
from typing import Final

from aiortc import MediaStreamTrack
from aiortc import RTCConfiguration
from aiortc import RTCPeerConnection
from aiortc import RTCSessionDescription
from aiortc.mediastreams import MediaStreamError
from av import AudioFrame
from av import AudioResampler
import numpy as np

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.gateway.voice_sound import BLOCK
from rt_robot_os.gateway.voice_sound import CallMicrophone
from rt_robot_os.gateway.voice_sound import Ducking
from rt_robot_os.gateway.voice_sound import level_db
from rt_robot_os.gateway.voice_sound import open_microphone
from rt_robot_os.gateway.voice_sound import open_speaker
from rt_robot_os.gateway.voice_sound import RATE_HZ
from rt_robot_os.gateway.voice_sound import Speaker
from rt_robot_os.linux.process import run_child

_CONNECT_S: Final = 15.0
_LINE_BYTES: Final = 1 << 20


class MicrophoneTrack(MediaStreamTrack):
    """The microphone of the robot as a WebRTC track."""

    kind = 'audio'

    def __init__(self, microphone: CallMicrophone, ducking: Ducking) -> None:
        super().__init__()
        self.problem = ''
        self._microphone = microphone
        self._ducking = ducking
        self._at = 0

    async def recv(self) -> AudioFrame:
        """
        Return the next 20 ms.

        :raises MediaStreamError: the microphone has failed.
        """
        try:
            samples = self._ducking.heard(await self._microphone.read())
        except DeviceError as error:
            self.problem = str(error)
            self.stop()
            raise MediaStreamError from error
        frame = AudioFrame.from_ndarray(samples.reshape(1, -1), format='s16', layout='mono')
        frame.sample_rate = RATE_HZ
        frame.pts = self._at
        frame.time_base = Fraction(1, RATE_HZ)
        self._at += BLOCK
        return frame


class VoiceCall:
    """
    One call.

    :param wanted: ``sdp``, ``microphone``, ``speaker``, ``duck_db``.
    """

    def __init__(self, wanted: dict[str, Any]) -> None:
        self._wanted = wanted
        self._ended = asyncio.Event()
        self._why = ''
        self._ducking = Ducking(float(wanted.get('duck_db', 0.0)))
        self._tasks: list[asyncio.Task[None]] = []

    def end(self, why: str) -> None:
        """End it; the first reason counts."""
        self._why = self._why or why
        self._ended.set()

    async def run(self) -> str:
        """
        Talk until it ends.

        :return: why it ended.
        """
        microphone: CallMicrophone | None = None
        speaker: Speaker | None = None
        peer = RTCPeerConnection(RTCConfiguration(iceServers=[]))
        try:
            microphone = open_microphone(str(self._wanted.get('microphone', '')), _told)
            speaker = open_speaker(str(self._wanted.get('speaker', '')))
            await self._connect(peer, microphone, speaker)
            await self._ended.wait()
        except (DeviceError, ValueError, KeyError, TypeError, AttributeError) as error:
            self.end(str(error) or type(error).__name__)
        finally:
            for task in self._tasks:
                task.cancel()
            with suppress(Exception):  # of a library, on the way out
                await asyncio.wait_for(peer.close(), 2.0)
            for device in (microphone, speaker):
                if device is not None:
                    device.close()
        return self._why

    async def _connect(self, peer: RTCPeerConnection, microphone: CallMicrophone, speaker: Speaker
                       ) -> None:
        def state_changed() -> None:
            _say(say='state', state=peer.connectionState)
            if peer.connectionState in ('failed', 'closed'):
                self.end('the connection between browser and robot is lost')

        def track_came(track: Any) -> None:
            if track.kind == 'audio':
                self._tasks.append(asyncio.ensure_future(self._play(track, speaker)))

        peer.on('connectionstatechange', state_changed)
        peer.on('track', track_came)
        peer.addTrack(MicrophoneTrack(microphone, self._ducking))
        await peer.setRemoteDescription(RTCSessionDescription(str(self._wanted['sdp']), 'offer'))
        await peer.setLocalDescription(await peer.createAnswer())
        _say(say='answer', sdp=peer.localDescription.sdp)
        asyncio.get_running_loop().call_later(_CONNECT_S, self._late, peer)

    def _late(self, peer: RTCPeerConnection) -> None:
        if peer.connectionState != 'connected':
            self.end('the robot cannot be reached from this browser: both have to be in the same '
                     'network')

    async def _play(self, track: Any, speaker: Speaker) -> None:
        resampler = AudioResampler(format='s16', layout='mono', rate=RATE_HZ)
        with suppress(MediaStreamError):
            while True:
                for frame in resampler.resample(await track.recv()):
                    samples = np.ascontiguousarray(frame.to_ndarray().reshape(-1), np.int16)
                    self._ducking.said(level_db(samples))
                    speaker.put(samples)


def _told(utc_ns: int, sample: int) -> None:
    _say(say='microphone', utc_ns=utc_ns, sample=sample)


def _say(**content: Any) -> None:
    sys.stdout.write(json.dumps(content) + '\n')
    sys.stdout.flush()


async def _talk() -> None:
    reader = asyncio.StreamReader(_LINE_BYTES)
    await asyncio.get_running_loop().connect_read_pipe(
        lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
    call = VoiceCall(json.loads(await reader.readline()))

    async def hear() -> None:
        while line := await reader.readline():
            if json.loads(line).get('do') == 'end':
                break
        call.end('the call is over')

    hearing = asyncio.ensure_future(hear())
    why = await call.run()
    hearing.cancel()
    _say(say='end', why=why)


def main(arguments: Sequence[str]) -> int:
    """Run one call."""
    asyncio.run(_talk())
    return 0


if __name__ == '__main__':
    sys.exit(run_child(main))
