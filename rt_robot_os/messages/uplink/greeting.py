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

"""How a gateway and a server greet each other on ``/robot/state``."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from dataclasses import dataclass
import json
import math
from typing import Any
from typing import ClassVar
from typing import Final
from typing import TypeVar

from rt_robot_os.messages.uplink.fields import cut_text_in
from rt_robot_os.messages.uplink.fields import is_count
from rt_robot_os.messages.uplink.fields import number_in
from rt_robot_os.messages.uplink.fields import text_in
from rt_robot_os.messages.uplink.fields import texts_in
from rt_robot_os.messages.uplink.fields import wrong
from rt_robot_os.messages.uplink.messages import UplinkMessage
from rt_robot_os.messages.uplink.messages import VERSION

#: Of a boot, and of the name of a person.
NAME_CHARACTERS: Final = 64
PEOPLE_MOST: Final = 64
#: Of one field about the robot, as JSON in ASCII: every page gets it with each change.
ABOUT_CHARACTERS: Final = 32 << 10
_T = TypeVar('_T')


@dataclass(frozen=True)
class NodePosition:
    """
    Where a node of the sensor network is mounted, in m on the map.

    :ivar person: who wears it; empty for one that is mounted.
    """

    id: int  # noqa: A003
    name: str
    x: float
    y: float
    z: float
    person: str = ''

    def content(self) -> dict[str, Any]:
        """Return it as JSON has it."""
        return {'id': self.id, 'name': self.name, 'x': self.x, 'y': self.y, 'z': self.z,
                'person': self.person}

    @classmethod
    def from_json(cls, found: Any) -> NodePosition:
        """
        Read it.

        :raises ValueError: it is malformed.
        """
        if not isinstance(found, dict):
            raise wrong('nodes', found, 'a list of objects')
        number = found.get('id')
        if not isinstance(number, int) or isinstance(number, bool):
            raise wrong('id', number, 'an integer')
        x, y, z = (number_in(found, name, 0.0) for name in 'xyz')
        return cls(number, cut_text_in(found, 'name', ABOUT_CHARACTERS), x, y, z,
                   cut_text_in(found, 'person', ABOUT_CHARACTERS))


@dataclass(frozen=True)
class DriveLimits:
    """
    How fast a driver may drive a robot; 0 where it cannot be driven.

    :ivar linear_m_s: ahead or back.
    :ivar angular_rad_s: turning.
    """

    linear_m_s: float = 0.0
    angular_rad_s: float = 0.0

    def content(self) -> dict[str, float]:
        """Return it as JSON has it; empty for a robot that cannot be driven."""
        if not self.linear_m_s:
            return {}
        return {'linear_m_s': self.linear_m_s, 'angular_rad_s': self.angular_rad_s}

    @classmethod
    def from_json(cls, found: Any) -> DriveLimits:
        """
        Read it; what is not a finite number above 0 is 0.

        :raises ValueError: it is not an object.
        """
        if not isinstance(found, dict):
            raise wrong('limits', found, 'an object')
        return cls(_limit(found.get('linear_m_s')), _limit(found.get('angular_rad_s')))


@dataclass(frozen=True)
class RobotHello(UplinkMessage):
    """
    The first message of a gateway: who the robot is, and what it can do.

    Of an older robot some of ``cameras`` to ``limits`` are missing: None.

    :ivar boot: UUID of this start of the gateway.
    :ivar robot: UUID of the robot; the server identifies it by its token.
    :ivar utc_ns: the robot's time of day; None when it is unknown.
    :ivar people: who may live with the robot: a suggestion.
    :ivar map: SHA-256 of its map; empty without one.
    :ivar version: 0 for one that cannot be read.
    :ivar too_long: how many fields were left out because they were too long.
    :ivar malformed: how many fields and items were left out because they were malformed.
    """

    KIND: ClassVar[str] = 'hello'

    boot: str
    robot: str = ''
    name: str = ''
    utc_ns: int | None = None
    people: tuple[str, ...] = ()
    cameras: tuple[str, ...] | None = None
    capabilities: tuple[str, ...] | None = None
    nodes: tuple[NodePosition, ...] | None = None
    map: str | None = None  # noqa: A003
    limits: DriveLimits | None = None
    version: int = VERSION
    too_long: int = 0
    malformed: int = 0

    def content(self) -> dict[str, Any]:
        """Return the fields on the wire."""
        about = self.about()
        capabilities = about.pop('capabilities', [])
        return {'version': about.pop('version'), 'robot': self.robot, 'name': self.name,
                'boot': self.boot, 'utc_ns': self.utc_ns, **about, 'people': list(self.people),
                'capabilities': capabilities}

    def about(self) -> dict[str, Any]:
        """Return what pages are shown of the robot; a field that it did not send is missing."""
        found: dict[str, Any] = {}
        if self.cameras is not None:
            found['cameras'] = list(self.cameras)
        if self.capabilities is not None:
            found['capabilities'] = list(self.capabilities)
        if self.nodes is not None:
            found['nodes'] = [each.content() for each in self.nodes]
        if self.map is not None:
            found['map'] = self.map
        if self.limits is not None:
            found['limits'] = self.limits.content()
        return {**found, 'version': self.version}

    @classmethod
    def from_json(cls, message: Mapping[str, Any]) -> RobotHello:
        """
        Read it; only a boot is indispensable.

        :raises ValueError: it has none.
        """
        version, utc_ns, robot_map = (message.get(name) for name in ('version', 'utc_ns', 'map'))
        reader = _AboutReader(message)
        if robot_map is not None and not isinstance(robot_map, str):
            reader.malformed += 1
        return cls(
            text_in(message, 'boot', NAME_CHARACTERS),
            cut_text_in(message, 'robot', NAME_CHARACTERS),
            cut_text_in(message, 'name', NAME_CHARACTERS),
            utc_ns if is_count(utc_ns) else None,
            tuple(texts_in(message, 'people', PEOPLE_MOST, NAME_CHARACTERS)),
            reader.items('cameras', _text), reader.items('capabilities', _text),
            reader.items('nodes', NodePosition.from_json),
            robot_map if isinstance(robot_map, str) and reader.fits('map') else None,
            reader.one('limits', DriveLimits.from_json),
            version if is_count(version) else 0, reader.too_long, reader.malformed)


class _AboutReader:
    """Read what pages are shown; what is malformed or too long is left out and counted."""

    def __init__(self, message: Mapping[str, Any]) -> None:
        self.too_long = self.malformed = 0
        self._message = message

    def fits(self, name: str) -> bool:
        """Return whether a field is there and short enough."""
        if self._message.get(name) is None:
            return False
        fits = len(json.dumps(self._message[name], separators=(',', ':'))) <= ABOUT_CHARACTERS
        self.too_long += not fits
        return fits

    def items(self, name: str, read: Callable[[Any], _T]) -> tuple[_T, ...] | None:
        """Read a list."""
        if not self.fits(name):
            return None
        value = self._message[name]
        if not isinstance(value, list):
            self.malformed += 1
            return None
        found = []
        for each in value:
            try:
                found.append(read(each))
            except ValueError:
                self.malformed += 1
        return tuple(found)

    def one(self, name: str, read: Callable[[Any], _T]) -> _T | None:
        """Read an object."""
        if not self.fits(name):
            return None
        try:
            return read(self._message[name])
        except ValueError:
            self.malformed += 1
            return None


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise wrong('an item', value, 'a string')
    return value


def _limit(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return 0.0
    return float(value) if math.isfinite(value) and value > 0.0 else 0.0


@dataclass(frozen=True)
class ServerWelcome(UplinkMessage):
    """
    The answer to a hello.

    :ivar utc_ns: the server's time of day.
    :ivar want_map: the server does not have the robot's map.
    """

    KIND: ClassVar[str] = 'welcome'

    utc_ns: int = 0
    want_map: bool = False
    version: int = VERSION

    def content(self) -> dict[str, Any]:
        """Return the fields on the wire."""
        return {'utc_ns': self.utc_ns, 'version': self.version, 'want_map': self.want_map}

    @classmethod
    def from_json(cls, message: Mapping[str, Any]) -> ServerWelcome:
        """Read it; nothing in it is indispensable."""
        utc_ns, version = message.get('utc_ns'), message.get('version')
        return cls(utc_ns if isinstance(utc_ns, int) else 0, message.get('want_map') is True,
                   version if isinstance(version, int) else VERSION)
