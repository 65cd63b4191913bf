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
The messages between a gateway and a server, as text: JSON objects with a ``kind``.

A robot has two connections. ``/robot/state`` carries these; ``/robot/media`` carries pictures and
files (:mod:`rt_robot_os.messages.uplink.media`), so that no alarm ever waits behind one. Each kind
has a class with its fields and limits; :mod:`rt_robot_os.messages.uplink.kinds` says which kinds
go which way. Neither side answers a kind that it does not know, nor reads a field that it does not
know: an older robot can talk to a newer server, and the other way round.

===========  =========  =======================================================================
kind         direction  class
===========  =========  =======================================================================
hello        up         :class:`.greeting.RobotHello`
records      up         :class:`.records.RecordBatch`
live         up         :class:`.live.LiveSignals`
answer       up         :class:`.commands.CommandAnswer`
map          up         :class:`.maps.MapMessage`; after ``want_map``, and when it changes
beat         up         :class:`.driving.DriveBeat`; while a driver may drive
welcome      down       :class:`.greeting.ServerWelcome`
stored       down       :class:`.records.BatchStored`
refused      down       :class:`.records.BatchRefused`
taken        down       :class:`.live.LiveReceived`
want         down       :class:`.live.WantedSignals`
command      down       :class:`.commands.RobotCommand`
drive_begin  down       :class:`.driving.DriveBegin`
drive        down       :class:`.driving.DriveCommand`
drive_end    down       :class:`.driving.DriveEnd`
voice        both       :class:`.voice.VoiceMessage`
===========  =========  =======================================================================
"""

from __future__ import annotations

from collections.abc import Mapping
import json
from typing import Any
from typing import ClassVar
from typing import Final

#: Raised when a message changes so that an older program would misread it.
VERSION: Final = 1
#: The longest text that either side accepts.
MESSAGE_BYTES: Final = 1 << 20


class UplinkMessage:
    """
    A message; each class is a frozen dataclass that checks its limits in :meth:`from_json`.

    :cvar KIND: its kind on the wire.
    """

    KIND: ClassVar[str]

    def content(self) -> dict[str, Any]:
        """Return the fields on the wire."""
        raise NotImplementedError

    @classmethod
    def from_json(cls, message: Mapping[str, Any]) -> UplinkMessage:
        """
        Read it.

        :param message: as :func:`decode` returns it; fields that are unknown are ignored.
        :raises ValueError: it is malformed.
        """
        raise NotImplementedError

    def to_json(self) -> str:
        """
        Write it.

        :raises ValueError: a number is not finite, which JSON cannot hold.
        """
        return encode(self.KIND, self.content())


def encode(kind: str, content: Mapping[str, Any]) -> str:
    """
    Write a message.

    :raises ValueError: a number is not finite, which JSON cannot hold.
    """
    return json.dumps({'kind': kind, **content}, ensure_ascii=False, allow_nan=False,
                      separators=(',', ':'))


def decode(text: str | bytes) -> dict[str, Any]:
    """
    Read a message.

    :return: it, with ``kind`` a string.
    :raises ValueError: it is not a message: too long, not JSON, not an object, without a kind, or
        with a number that is not finite.
    """
    if len(text) > MESSAGE_BYTES:
        raise ValueError(f'a message of {len(text)} bytes; {MESSAGE_BYTES} are the most')
    try:
        found = json.loads(text, parse_constant=_refuse)
    except RecursionError:
        raise ValueError('a message that is nested too deeply') from None
    except UnicodeDecodeError as error:
        raise ValueError(f'a message that is not UTF-8: {error.reason}') from None
    if not isinstance(found, dict) or not isinstance(found.get('kind'), str):
        raise ValueError('a message without a kind')
    return found


def _refuse(name: str) -> float:
    raise ValueError(f'a message with {name}, which JSON does not have')
