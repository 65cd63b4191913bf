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

"""Which messages go which way on which connection, by their kind."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any
from typing import Final

from rt_robot_os.messages.uplink.commands import CommandAnswer
from rt_robot_os.messages.uplink.commands import RobotCommand
from rt_robot_os.messages.uplink.driving import DriveBeat
from rt_robot_os.messages.uplink.driving import DriveBegin
from rt_robot_os.messages.uplink.driving import DriveCommand
from rt_robot_os.messages.uplink.driving import DriveEnd
from rt_robot_os.messages.uplink.frames import decode_frame
from rt_robot_os.messages.uplink.frames import UplinkFrame
from rt_robot_os.messages.uplink.greeting import RobotHello
from rt_robot_os.messages.uplink.greeting import ServerWelcome
from rt_robot_os.messages.uplink.live import LiveReceived
from rt_robot_os.messages.uplink.live import LiveSignals
from rt_robot_os.messages.uplink.live import WantedSignals
from rt_robot_os.messages.uplink.maps import MapMessage
from rt_robot_os.messages.uplink.media import CameraTrouble
from rt_robot_os.messages.uplink.media import ClockReply
from rt_robot_os.messages.uplink.media import ClockRequest
from rt_robot_os.messages.uplink.media import FileOffer
from rt_robot_os.messages.uplink.media import FilePart
from rt_robot_os.messages.uplink.media import FileProgress
from rt_robot_os.messages.uplink.media import FileRefusal
from rt_robot_os.messages.uplink.media import MediaHello
from rt_robot_os.messages.uplink.media import PictureFrame
from rt_robot_os.messages.uplink.media import PictureReceived
from rt_robot_os.messages.uplink.media import WantedCameras
from rt_robot_os.messages.uplink.messages import UplinkMessage
from rt_robot_os.messages.uplink.records import BatchRefused
from rt_robot_os.messages.uplink.records import BatchStored
from rt_robot_os.messages.uplink.records import RecordBatch
from rt_robot_os.messages.uplink.voice import VoiceMessage

Kinds = Mapping[str, type[UplinkMessage]]


def _by_kind(*classes: type[UplinkMessage]) -> Kinds:
    return MappingProxyType({each.KIND: each for each in classes})


#: On ``/robot/state``, from the robot and to it.
STATE_UP: Final = _by_kind(RobotHello, RecordBatch, LiveSignals, CommandAnswer, MapMessage,
                           DriveBeat, VoiceMessage)
STATE_DOWN: Final = _by_kind(ServerWelcome, BatchStored, BatchRefused, LiveReceived, WantedSignals,
                             RobotCommand, DriveBegin, DriveCommand, DriveEnd, VoiceMessage)
#: On ``/robot/media``.
MEDIA_UP: Final = _by_kind(MediaHello, CameraTrouble, ClockRequest, FileOffer)
MEDIA_DOWN: Final = _by_kind(PictureReceived, WantedCameras, ClockReply, FileProgress, FileRefusal)
FRAMES: Final[Mapping[str, type[UplinkFrame]]] = MappingProxyType({
    each.KIND: each for each in (PictureFrame, FilePart)})


def read(kinds: Kinds, message: Mapping[str, Any]) -> UplinkMessage | None:
    """
    Read a message that was decoded.

    :return: None for a kind that this release does not know.
    :raises ValueError: it is malformed.
    """
    found = kinds.get(message['kind'])
    return None if found is None else found.from_json(message)


def read_frame(frame: bytes) -> UplinkFrame | None:
    """
    Read a frame of ``/robot/media``.

    :return: None for a kind that this release does not know.
    :raises ValueError: it is malformed.
    """
    header, payload = decode_frame(frame)
    found = FRAMES.get(header['kind'])
    return None if found is None else found.from_frame(header, payload)
