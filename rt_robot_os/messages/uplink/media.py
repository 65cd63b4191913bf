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
The messages of ``/robot/media``: pictures while they are watched, files of alarms part by part.

The robot sends one picture of a camera at a time, and the next when the server has that one. It
offers a file, the server says how much of it there is, and the robot sends the part that follows.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field
from typing import Any
from typing import ClassVar
from typing import Final

from rt_robot_os.messages.uplink.fields import count_in
from rt_robot_os.messages.uplink.fields import cut_text_in
from rt_robot_os.messages.uplink.fields import loose_object_in
from rt_robot_os.messages.uplink.fields import number_in
from rt_robot_os.messages.uplink.fields import object_in
from rt_robot_os.messages.uplink.fields import wrong
from rt_robot_os.messages.uplink.frames import UplinkFrame
from rt_robot_os.messages.uplink.messages import UplinkMessage
from rt_robot_os.messages.uplink.messages import VERSION

#: Of the name of a camera, and of the id of a file.
NAME_CHARACTERS: Final = 64
CAMERAS_MOST: Final = 32
#: Of why a camera gives no picture, or a file was refused.
REASON_CHARACTERS: Final = 300


@dataclass(frozen=True)
class MediaHello(UplinkMessage):
    """The cameras of a robot; sent at first, and when there are others."""

    KIND: ClassVar[str] = 'hello'

    cameras: tuple[str, ...]
    version: int = VERSION

    def content(self) -> dict[str, Any]:
        """Return the fields on the wire."""
        return {'version': self.version, 'cameras': list(self.cameras)}

    @classmethod
    def from_json(cls, message: Mapping[str, Any]) -> MediaHello:
        """
        Read it.

        :raises ValueError: it has no list of cameras.
        """
        cameras = message.get('cameras')
        if not isinstance(cameras, list):
            raise wrong('cameras', cameras, 'a list')
        version = message.get('version')
        return cls(tuple(str(each)[:NAME_CHARACTERS] for each in cameras[:CAMERAS_MOST]),
                   version if isinstance(version, int) else 0)


@dataclass(frozen=True)
class CameraTrouble(UplinkMessage):
    """
    Why a camera gives no picture, as its device says it.

    :ivar text: empty when there are pictures again.
    """

    KIND: ClassVar[str] = 'trouble'

    camera: str
    text: str
    codes: Mapping[str, Any] = field(default_factory=dict)

    def content(self) -> dict[str, Any]:
        """Return the fields on the wire."""
        return {'camera': self.camera, 'text': self.text, 'codes': dict(self.codes)}

    @classmethod
    def from_json(cls, message: Mapping[str, Any]) -> CameraTrouble:
        """
        Read it.

        :raises ValueError: it lacks a camera or a text.
        """
        _require(message, 'camera', 'text')
        return cls(cut_text_in(message, 'camera', NAME_CHARACTERS),
                   cut_text_in(message, 'text', REASON_CHARACTERS),
                   loose_object_in(message, 'codes'))


@dataclass(frozen=True)
class ClockRequest(UplinkMessage):
    """
    The robot asks for the server's time of day.

    :ivar t: CLOCK_MONOTONIC of the robot, in ns; the answer repeats it.
    """

    KIND: ClassVar[str] = 'clock'

    t: int

    def content(self) -> dict[str, Any]:
        """Return the fields on the wire."""
        return {'t': self.t}

    @classmethod
    def from_json(cls, message: Mapping[str, Any]) -> ClockRequest:
        """
        Read it.

        :raises ValueError: it has no time.
        """
        return cls(count_in(message, 't'))


@dataclass(frozen=True)
class ClockReply(UplinkMessage):
    """The server's time of day, and the time of the request."""

    KIND: ClassVar[str] = 'clock'

    t: int
    utc_ns: int

    def content(self) -> dict[str, Any]:
        """Return the fields on the wire."""
        return {'t': self.t, 'utc_ns': self.utc_ns}

    @classmethod
    def from_json(cls, message: Mapping[str, Any]) -> ClockReply:
        """
        Read it.

        :raises ValueError: a time is missing.
        """
        return cls(count_in(message, 't'), count_in(message, 'utc_ns'))


@dataclass(frozen=True)
class PictureReceived(UplinkMessage):
    """The server has received a picture: the robot may send the next of this camera."""

    KIND: ClassVar[str] = 'taken'

    camera: str
    n: int

    def content(self) -> dict[str, Any]:
        """Return the fields on the wire."""
        return {'camera': self.camera, 'n': self.n}

    @classmethod
    def from_json(cls, message: Mapping[str, Any]) -> PictureReceived:
        """
        Read it.

        :raises ValueError: it lacks the camera or the number.
        """
        _require(message, 'camera')
        return cls(str(message['camera']), count_in(message, 'n'))


@dataclass(frozen=True)
class WantedCameras(UplinkMessage):
    """How many pictures a second pages want, by camera."""

    KIND: ClassVar[str] = 'want'

    cameras: Mapping[str, float]

    def content(self) -> dict[str, Any]:
        """Return the fields on the wire."""
        return {'cameras': dict(self.cameras)}

    @classmethod
    def from_json(cls, message: Mapping[str, Any]) -> WantedCameras:
        """
        Read it.

        :raises ValueError: it is not an object of numbers.
        """
        cameras = object_in(message, 'cameras')
        return cls({str(name): number_in(cameras, name) for name in cameras})


@dataclass(frozen=True)
class FileOffer(UplinkMessage):
    """A file that the robot has for the server."""

    KIND: ClassVar[str] = 'offer'

    id: str  # noqa: A003
    sha256: str
    size: int

    def content(self) -> dict[str, Any]:
        """Return the fields on the wire."""
        return {'id': self.id, 'sha256': self.sha256, 'size': self.size}

    @classmethod
    def from_json(cls, message: Mapping[str, Any]) -> FileOffer:
        """
        Read it.

        :raises ValueError: a field is missing.
        """
        _require(message, 'id', 'sha256')
        return cls(cut_text_in(message, 'id', NAME_CHARACTERS), str(message['sha256']),
                   count_in(message, 'size'))


@dataclass(frozen=True)
class FileProgress(UplinkMessage):
    """
    How much of a file the server has.

    :ivar offset: where the robot goes on; the size of the file when all of it is there.
    """

    KIND: ClassVar[str] = 'have'

    id: str  # noqa: A003
    offset: int

    def content(self) -> dict[str, Any]:
        """Return the fields on the wire."""
        return {'id': self.id, 'offset': self.offset}

    @classmethod
    def from_json(cls, message: Mapping[str, Any]) -> FileProgress:
        """
        Read it.

        :raises ValueError: a field is missing.
        """
        _require(message, 'id')
        return cls(str(message['id']), count_in(message, 'offset'))


@dataclass(frozen=True)
class FileRefusal(UplinkMessage):
    """
    The server does not take a file now.

    :ivar retry_s: from now until it may be offered again; 0: never.
    """

    KIND: ClassVar[str] = 'refused'

    id: str  # noqa: A003
    text: str
    retry_s: float = 0.0

    def content(self) -> dict[str, Any]:
        """Return the fields on the wire."""
        return {'id': self.id, 'text': self.text, 'retry_s': self.retry_s}

    @classmethod
    def from_json(cls, message: Mapping[str, Any]) -> FileRefusal:
        """
        Read it.

        :raises ValueError: it names no file.
        """
        _require(message, 'id')
        return cls(str(message['id']), cut_text_in(message, 'text', REASON_CHARACTERS),
                   number_in(message, 'retry_s', 0.0))


@dataclass(frozen=True)
class PictureFrame(UplinkFrame):
    """
    A picture of a camera.

    :ivar n: counts the pictures of this camera.
    :ivar utc_ns: of its capture, by the robot's time of day, which may be wrong by years.
    :ivar age_ns: how old it was when it was sent, by the robot's monotonic clock.
    :ivar server_ns: of its capture, by the server's time of day; 0 while the robot does not know.
    :ivar width: in pixels; 0: not told.
    :ivar payload: JPEG.
    """

    KIND: ClassVar[str] = 'picture'

    camera: str
    n: int
    payload: bytes | memoryview
    utc_ns: int = 0
    age_ns: int = 0
    server_ns: int = 0
    width: int = 0
    height: int = 0

    def header(self) -> dict[str, Any]:
        """Return the fields of its header."""
        size = {'width': self.width, 'height': self.height} if self.width or self.height else {}
        return {'camera': self.camera, 'n': self.n, 'utc_ns': self.utc_ns, 'age_ns': self.age_ns,
                'server_ns': self.server_ns, **size}

    @classmethod
    def from_frame(cls, header: Mapping[str, Any], payload: memoryview) -> PictureFrame:
        """
        Read it.

        :raises ValueError: a field is missing or malformed.
        """
        _require(header, 'camera')
        utc_ns = header.get('utc_ns', 0)
        return cls(str(header['camera']), count_in(header, 'n'), payload,
                   utc_ns if isinstance(utc_ns, int) else 0, count_in(header, 'age_ns', 0),
                   count_in(header, 'server_ns', 0), count_in(header, 'width', 0),
                   count_in(header, 'height', 0))


@dataclass(frozen=True)
class FilePart(UplinkFrame):
    """Some bytes of a file that was offered."""

    KIND: ClassVar[str] = 'part'

    id: str  # noqa: A003
    offset: int
    payload: bytes | memoryview

    def header(self) -> dict[str, Any]:
        """Return the fields of its header."""
        return {'id': self.id, 'offset': self.offset}

    @classmethod
    def from_frame(cls, header: Mapping[str, Any], payload: memoryview) -> FilePart:
        """
        Read it.

        :raises ValueError: a field is missing or malformed.
        """
        _require(header, 'id')
        return cls(str(header['id']), count_in(header, 'offset'), payload)


def _require(message: Mapping[str, Any], *names: str) -> None:
    for name in names:
        if name not in message:
            raise ValueError(f'{name} is missing')
