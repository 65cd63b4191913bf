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
The set-up of a StarGazer: stop, compare and write its parameters, start.

The vendor requires 50 ms between the bytes of a command, so a command takes half a second and the
set-up some seconds. Nothing here blocks: the driver calls :meth:`StarGazerSetup.due` in each
round.

Each parameter is read first. The flash memory of the device is written only if one of them must
change, and not at each start of the robot.
"""

from __future__ import annotations

from collections.abc import Generator
from collections.abc import Mapping
from collections.abc import Sequence
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.stargazer import wire
from rt_robot_os.devices.stargazer.wire import StarGazerFrame

# The vendor's 50 ms, plus the possible delay of the device's task between reading the clock and
# writing.
PAUSE_NS: Final = 55 * NS_PER_MS
MAP_BUILDING: Final = 'map_building'
HEIGHT_CALCULATION: Final = 'height_calculation'
NO_PROCEDURE: Final = 'none'
PROCEDURES: Final = (NO_PROCEDURE, MAP_BUILDING, HEIGHT_CALCULATION)

_ANSWER_NS: Final = 500 * NS_PER_MS
# Writing its flash memory takes 2 to 3 s, during which it receives nothing.
_DEAF_NS: Final = 6 * NS_PER_S
_TRIES: Final = 5
# It may miss a command while it streams.
_STOP_TRIES: Final = 10
_READ_TRIES: Final = 2
_REMEDY: Final = ('check the wire to its receive pin, or set configure: false and set it up with '
                  "the vendor's program")


class SetupExchange(NamedTuple):
    """
    One command and its expected answer.

    :ivar data: the bytes to send; empty to only wait.
    :ivar kind: of the sentence that answers it.
    :ivar content: of that sentence; the part after the name may be missing.
    :ivar optional: a missing answer is not an error.
    """

    data: bytes
    kind: str
    content: str
    tries: int = _TRIES
    answer_ns: int = _ANSWER_NS
    optional: bool = False


class StarGazerSetup:
    """
    The set-up after one opening; safe in the loop.

    :ivar done: the device was commanded to start.
    :ivar written: parameters that differed and were written.
    """

    def __init__(self, name: str, parameters: Sequence[tuple[str, str]], procedure: str) -> None:
        """
        Begin.

        :param name: of the device, for errors.
        :param parameters: values to set, by the vendor's names.
        :param procedure: one of ``PROCEDURES``, started after the parameters are set.
        """
        self.done = False
        self.written: list[str] = []
        self._name = name
        self._exchange: SetupExchange | None = None
        self._left = b''
        self._tries = 0
        self._byte_ns = 0
        self._until_ns = 0
        self._script = self._dialogue(parameters, procedure)
        self._next(None)

    def due(self, now_ns: int) -> bytes | None:
        """
        Return the byte to send now; None if there is none.

        :raises DeviceError: the device does not answer.
        """
        if self._exchange is None:
            return None
        if self._left:
            return self._byte(now_ns)
        if not self._until_ns:  # from now on it only waits
            self._until_ns = now_ns + self._exchange.answer_ns
        if now_ns >= self._until_ns:
            self._again(self._exchange)
        return self._byte(now_ns) if self._left else None

    def handle(self, frame: StarGazerFrame) -> bool:
        """Handle a sentence if it is the expected answer; return whether it was."""
        wanted = self._exchange
        if wanted is None or frame.kind != wanted.kind:
            return False
        name, _, value = frame.content.partition('|')
        expected, _, expected_value = wanted.content.partition('|')
        if name != expected or (value and expected_value and not _same(value, expected_value)):
            return False
        self._next(frame)
        return True

    def _byte(self, now_ns: int) -> bytes | None:
        if now_ns < self._byte_ns:
            return None
        byte, self._left = self._left[:1], self._left[1:]
        self._byte_ns = now_ns + PAUSE_NS
        if not self._left and self._exchange is not None:
            self._until_ns = now_ns + self._exchange.answer_ns
        return byte

    def _again(self, exchange: SetupExchange) -> None:
        self._tries += 1
        if self._tries < exchange.tries:
            self._left = exchange.data
        elif exchange.optional:
            self._next(None)
        else:
            raise DeviceError(f'{self._name}: it does not acknowledge {exchange.content} '
                              f'({self._tries} tries): {_REMEDY}')

    def _next(self, answer: StarGazerFrame | None) -> None:
        try:
            exchange = next(self._script) if self._exchange is None else (
                self._script.send(answer))
        except StopIteration:
            self._exchange = None
            self._left = b''
            self.done = True
            return
        self._exchange = exchange
        self._left = exchange.data
        self._tries = 0
        self._until_ns = 0

    def _dialogue(self, parameters: Sequence[tuple[str, str]], procedure: str
                  ) -> Generator[SetupExchange, StarGazerFrame | None, None]:
        yield _command(wire.STOP, _STOP_TRIES)
        for name, value in parameters:
            found = yield SetupExchange(wire.sentence(wire.READ, name), wire.VALUE, name,
                                        _READ_TRIES, optional=True)
            if found is None or not _same(found.content.partition('|')[2], value):
                yield _command(f'{name}|{value}')
                self.written.append(name)
        if self.written:
            yield _command(wire.END)
            yield SetupExchange(b'', wire.ACKNOWLEDGEMENT, wire.UPDATED, 1, _DEAF_NS,
                                optional=True)
        if procedure == MAP_BUILDING:
            yield _command(wire.BUILD_MAP)
        elif procedure == HEIGHT_CALCULATION:
            yield _command(wire.HEIGHT_CALCULATION)
        yield _command(wire.START)


def _command(content: str, tries: int = _TRIES) -> SetupExchange:
    return SetupExchange(wire.sentence(wire.WRITE, content), wire.ACKNOWLEDGEMENT, content, tries)


def _same(found: str, wanted: str) -> bool:
    if found.isdigit() and wanted.isdigit() and len(found) < 10:
        return int(found) == int(wanted)
    return found.strip().lower() == wanted.lower()


def parameters_of(settings: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return the values to set in the device, by the vendor's names, in the vendor's order."""
    found: list[tuple[str, str]] = []
    if settings['threshold']:
        found += [('ThrAlg', 'Manual'), ('ThrVal', str(settings['threshold']))]
    for name, value in (
            ('MarkType', settings['mark_type']), ('MarkDim', settings['mark_dim']),
            ('MarkMode', settings['mark_mode']),
            ('MarkHeight', round(settings['mark_height_m'] * 1000)),
            ('HeightFix', {'fixed': 'Yes', 'automatic': 'No'}.get(settings['height_mode'])),
            ('IDNum', settings['mark_count']), ('RefID', settings['reference_id'])):
        if value:
            found.append((name, str(value)))
    return found
