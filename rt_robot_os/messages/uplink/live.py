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

"""Live signals, and how many of them the server wants."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from typing import ClassVar
from typing import Final

from rt_robot_os.messages.uplink.fields import count_in
from rt_robot_os.messages.uplink.fields import number_in
from rt_robot_os.messages.uplink.fields import object_in
from rt_robot_os.messages.uplink.messages import UplinkMessage

#: Names of signals, or patterns of them, in one message, and the characters of each.
PATTERNS_MOST: Final = 1024
PATTERN_CHARACTERS: Final = 200
_HZ_MOST: Final = 1e6


@dataclass(frozen=True)
class LiveSignals(UplinkMessage):
    """
    The newest values of signals.

    :ivar n: counts these messages.
    :ivar signals: by name: a list of UTC in ns and value; the server counts what is anything else.
    """

    KIND: ClassVar[str] = 'live'

    n: int
    utc_ns: int
    signals: Mapping[str, Any]

    def content(self) -> dict[str, Any]:
        """Return the fields on the wire."""
        return {'n': self.n, 'utc_ns': self.utc_ns, 'signals': dict(self.signals)}

    @classmethod
    def from_json(cls, message: Mapping[str, Any]) -> LiveSignals:
        """
        Read it.

        :raises ValueError: it is malformed.
        """
        return cls(count_in(message, 'n'), count_in(message, 'utc_ns'),
                   object_in(message, 'signals'))


@dataclass(frozen=True)
class LiveReceived(UplinkMessage):
    """The server has received live signals up to a number: the robot may send more."""

    KIND: ClassVar[str] = 'taken'

    n: int

    def content(self) -> dict[str, Any]:
        """Return the fields on the wire."""
        return {'n': self.n}

    @classmethod
    def from_json(cls, message: Mapping[str, Any]) -> LiveReceived:
        """
        Read it.

        :raises ValueError: it has no number.
        """
        return cls(count_in(message, 'n'))


@dataclass(frozen=True)
class WantedSignals(UplinkMessage):
    """
    How often the server wants live signals.

    :ivar signals_hz: 0 while no page shows the robot.
    :ivar signals: patterns of the names that pages show; None of an older server.
    """

    KIND: ClassVar[str] = 'want'

    signals_hz: float
    signals: tuple[str, ...] | None = None

    def content(self) -> dict[str, Any]:
        """Return the fields on the wire."""
        found: dict[str, Any] = {'signals_hz': self.signals_hz}
        return found if self.signals is None else {**found, 'signals': list(self.signals)}

    @classmethod
    def from_json(cls, message: Mapping[str, Any]) -> WantedSignals:
        """
        Read it.

        :raises ValueError: it has no rate.
        """
        names = message.get('signals')
        signals = tuple(str(each)[:PATTERN_CHARACTERS] for each in names[:PATTERNS_MOST]
                        ) if isinstance(names, list) else None
        return cls(number_in(message, 'signals_hz', low=0.0, high=_HZ_MOST), signals)
