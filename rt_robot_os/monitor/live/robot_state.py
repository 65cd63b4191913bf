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

"""The state of a robot on the server: identity, newest signals, open alarms."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field
import json
from typing import Any
from typing import Final

from rt_robot_os.messages.alarm_event import AlarmEvent
from rt_robot_os.messages.alarm_event import CODEC as ALARM_EVENT
from rt_robot_os.messages.texts.coded import codes_of
from rt_robot_os.messages.texts.signals import codes_of_signals
from rt_robot_os.monitor.live.memory_use import memory_of
from rt_robot_os.monitor.live.rights import Rights
from rt_robot_os.monitor.live.rights import without
from rt_robot_os.monitor.store.alarm_reuse import is_reused

#: Most stored signals of a robot; further ones are counted and dropped.
SIGNALS_MOST: Final = 2000
#: Longest name of a signal.
SIGNAL_NAME_CHARACTERS: Final = 256
#: Memory limits of one signal and of all signals of a robot; a larger value becomes null and is
#: counted.
SIGNAL_BYTES: Final = 2 << 20
SIGNALS_BYTES: Final = 8 << 20
#: Most cached texts of a signal, for groups of clients with different rights.
_TEXTS_MOST: Final = 16
#: Longest value; a longer one is null in messages.
SIGNAL_CHARACTERS: Final = 256 << 10
#: Most open alarms in memory; further ones and closed ones are only in the database.
ALARMS_MOST: Final = 200
#: Texts of an alarm that the page translates by their codes.
_WORDED: Final = ('text', 'why')
#: Largest size of the codes that a robot of another release sends.
_CODES_CHARACTERS: Final = 4000


def encoded(value: Any) -> str:
    """Encode a value for messages to the page."""
    # ASCII only, so that a WebSocket accepts every value.
    return json.dumps(value, allow_nan=False, separators=(',', ':'))


class Signal:
    """
    The newest value of a signal.

    :ivar version: the robot's version counter when it was received.
    :ivar size: memory used by the value, in bytes.
    """

    __slots__ = ('version', 'utc_ns', 'value', 'size', '_name', '_texts')

    def __init__(self, name: str, version: int, utc_ns: int, value: Any, size: int = 0) -> None:
        self.size = size
        self.version = version
        self.utc_ns = utc_ns
        self.value = value
        self._name = name
        self._texts: dict[frozenset[str], str] = {}

    def text(self, hidden: frozenset[str]) -> str:
        """Return it as a member of a JSON object, encoded once for clients with equal rights."""
        found = self._texts.get(hidden)
        if found is None:
            if len(self._texts) >= _TEXTS_MOST:
                del self._texts[next(iter(self._texts))]
            found = self._texts[hidden] = self._encode(hidden)
        return found

    def _encode(self, hidden: frozenset[str]) -> str:
        try:
            value = encoded([self.utc_ns, without(self.value, hidden)])
        except (RecursionError, ValueError):
            value = ''
        if not 0 < len(value) <= SIGNAL_CHARACTERS:
            value = encoded([self.utc_ns, None])
        return f'{encoded(self._name)}:{value}'


@dataclass
class RobotState:
    """
    A robot.

    :ivar people: its confirmed residents; None until they were confirmed once.
    :ivar ever: these, and people about whom it sent records earlier.
    :ivar suggested: the people that it named when it connected.
    :ivar retired: its token was revoked, so its absence is intended.
    :ivar lost: records that the robot has dropped, by importance, as counted by the robot.
    :ivar version: counter of live messages; a signal stores the version at its arrival.
    :ivar signals_bytes: memory used by the values of its signals.
    :ivar heard: time of its last message, by the loop's clock.
    :ivar offset_s: how far its clock is ahead of the server's.
    """

    id: str  # noqa: A003
    name: str
    people: frozenset[str] | None = None
    ever: frozenset[str] = frozenset()
    suggested: frozenset[str] = frozenset()
    connected: bool = False
    silent: bool = True
    retired: bool = False
    last_seen_ns: int = 0
    heard: float = 0.0
    boot: str = ''
    about: dict[str, Any] = field(default_factory=dict)
    offset_s: float = 0.0
    version: int = 0
    live_n: int = 0
    live_utc_ns: int = 0
    names: int = 0
    signals: dict[str, Signal] = field(default_factory=dict)
    alarms: dict[str, dict[str, Any]] = field(default_factory=dict)
    _alarm_boots: dict[str, str] = field(default_factory=dict)
    counts: dict[str, int] = field(default_factory=dict)
    lost: dict[str, int] = field(default_factory=dict)
    wanted: tuple[float, tuple[str, ...]] = (-1.0, ())
    signals_bytes: int = 0

    def count(self, what: str, how_many: int = 1) -> None:
        """Increment a counter of this robot, for `/api/status`."""
        self.counts[what] = self.counts.get(what, 0) + how_many

    @property
    def named(self) -> frozenset[str]:
        """Return the people whose names may occur in its messages."""
        return self.ever | self.suggested

    def lives_with(self, people: Iterable[str] | None, ever: Iterable[str] = ()) -> None:
        """Set its confirmed residents, and the people about whom it has sent records."""
        self.people = None if people is None else frozenset(people)
        self.ever = frozenset(ever) | (self.people or frozenset())
        if self.signals:  # signals that may be shown from now on count as new
            self.version += 1
            for each in self.signals.values():
                each.version = self.version

    def knows(self, signal: str) -> bool:
        """Return whether a signal is about no person, or about a confirmed resident."""
        kind, _, rest = signal.partition('/')
        return kind != 'health' or rest.partition('/')[0] in (self.people or ())

    def take(self, utc_ns: int, n: int, signals: Mapping[str, Any]) -> None:
        """Store the signals of a ``live`` message; invalid entries are counted."""
        self.version += 1
        self.live_n, self.live_utc_ns = n, utc_ns
        for name, pair in (*signals.items(), *codes_of_signals(signals).items()):
            if not (isinstance(pair, list) and len(pair) == 2 and is_time(pair[0])
                    and len(name) <= SIGNAL_NAME_CHARACTERS):
                self.count('signals_wrong')
            elif name not in self.signals and len(self.signals) >= SIGNALS_MOST:
                self.count('signals_too_many')
            else:
                self._store(name, pair[0], pair[1])

    def drop_signals(self, is_dropped: Callable[[str, Any], bool]) -> None:
        """Remove signals, by name and value, until they are sent again."""
        self.signals = {name: each for name, each in self.signals.items()
                        if not is_dropped(name, each.value)}
        self.signals_bytes = sum(each.size for each in self.signals.values())
        self.names += 1

    def _store(self, name: str, utc_ns: int, value: Any) -> None:
        before = self.signals.get(name)
        others = self.signals_bytes - (before.size if before is not None else 0)
        most = min(SIGNAL_BYTES, SIGNALS_BYTES - others)
        size = memory_of(value, most)
        if size > most:
            self.count('signals_too_long')
            value, size = None, 0
        self.names += before is None
        self.signals_bytes = others + size
        self.signals[name] = Signal(name, self.version, utc_ns, value, size)

    def take_alarm(self, event: Mapping[str, Any], utc_ns: int, boot: str = ''
                   ) -> dict[str, Any] | None:
        """
        Apply an event of an alarm.

        :param boot: the start of the robot that made it.
        :return: the present state of the alarm; None when the event changes nothing because it or
            a newer one was received before.
        """
        try:
            parsed = AlarmEvent.from_dict(event)
        except ValueError:
            self.count('alarms_wrong')
            return None
        alarm, seq = parsed.alarm, parsed.seq
        before = self.alarms.get(alarm)
        if before is not None and self._is_another(before, parsed, utc_ns, boot):
            self.count('alarm_names_reused')
            self.alarms.pop(alarm)
            before = None
        if before is not None and (seq <= before['seq'] if 'seq' in before
                                   else utc_ns < before['utc_ns']):
            return None
        now = {**(before or {}), **_known(event), 'id': alarm, 'robot': self.id, 'seq': seq,
               'utc_ns': utc_ns, 'opened_ns': (before or {}).get('opened_ns', utc_ns),
               'is_open': parsed.is_open}
        if before is None and len(self.alarms) >= ALARMS_MOST:
            self._forget_one()
        self.alarms[alarm] = now
        self._alarm_boots[alarm] = boot
        return now

    def _is_another(self, before: Mapping[str, Any], event: AlarmEvent, utc_ns: int, boot: str
                    ) -> bool:
        """Return whether a journal was lost and a name of an alarm is used again."""
        is_later = boot == self.boot and boot != self._alarm_boots.get(before['id'])
        return 'seq' in before and is_reused(
            event, event.seq, utc_ns, before['seq'], before['utc_ns'], later_start=is_later)

    def _forget_one(self) -> None:
        closed = next((key for key, each in self.alarms.items() if not each['is_open']), None)
        forgotten = closed if closed is not None else next(iter(self.alarms))
        del self.alarms[forgotten]
        self._alarm_boots.pop(forgotten, None)
        self.count('alarms_forgotten')

    def shown(self, rights: Rights) -> dict[str, Any]:
        """Return the robot as visible with these rights."""
        hidden = rights.hidden(self.named)
        return {'id': self.id, 'name': without(self.name, hidden), 'connected': self.connected,
                'silent': self.silent, 'retired': self.retired, 'last_seen_ns': self.last_seen_ns,
                'people': sorted(filter(rights.sees_person, self.people or ())),
                'clock_offset_s': round(self.offset_s, 3), **without(self.about, hidden)}

    def alarm_shown(self, alarm: Mapping[str, Any], rights: Rights) -> dict[str, Any] | None:
        """Return an alarm as visible with these rights; None when it is not visible."""
        if not rights.sees_robot(self.people):
            return None
        hidden = rights.hidden(self.named)
        if alarm.get('subject') in hidden:
            return None
        shown: dict[str, Any] = without(_with_codes(alarm), hidden)
        return shown


def _with_codes(alarm: Mapping[str, Any]) -> dict[str, Any]:
    """Return an alarm and its events, with the codes of their texts added."""
    found = {**alarm, 'codes': codes_of(alarm, _WORDED)}
    if 'events' in alarm:
        found['events'] = [{**each, 'codes': codes_of(each, _WORDED)} for each in alarm['events']]
    return found


def _known(event: Mapping[str, Any]) -> dict[str, Any]:
    """Return the public part of an event of an alarm, each field of bounded length."""
    found = ALARM_EVENT.known(event)
    kinds = found.pop('kinds', None)
    found.pop('seq', None)
    codes = event.get('codes')
    if isinstance(codes, dict) and memory_of(codes, _CODES_CHARACTERS) <= _CODES_CHARACTERS:
        found['codes'] = {key: each for key, each in codes.items() if key in _WORDED}
    if kinds is not None:
        found['kinds'] = list(kinds)
    return found


def is_time(value: object) -> bool:
    """Return whether it is a valid time in ns: 64 bits, not negative."""
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 1 << 63
