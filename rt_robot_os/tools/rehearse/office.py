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
Those behind the robot on the stage: the disk, the channels, who is told, who operates it.

Another program may call for somebody, too.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from functools import partial
import json
import math
from random import Random
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.alarms.journal_file import DiskReserve
from rt_robot_os.features.alarms.journal_file import JournalFile
from rt_robot_os.features.alarms.journal_store import MemoryStore
from rt_robot_os.messages.fields import compact
from rt_robot_os.tools.rehearse.body import Body
from rt_robot_os.tools.rehearse.stage import Stage
from rt_robot_os.tools.rehearse.story import CALLERS
from rt_robot_os.tools.rehearse.story import Carer
from rt_robot_os.topics import Publisher
from rt_robot_os.topics import Subscription

#: The name under which the carer acknowledges and resolves.
CARER: Final = 'carer'
# What is written is on the disk so much later, and a channel answers so much later.
_DISK_NS: Final = 5 * NS_PER_MS
_CHANNEL_NS: Final = 800 * NS_PER_MS
_RETRY_NS: Final = 2 * NS_PER_S
_DISK_BYTES: Final = 1 << 30
# As the device has it where nobody says otherwise.
_JOURNAL_BYTES: Final = 1 << 20
_BEAT_NS: Final = 5 * NS_PER_S
# What lasts is told again that often.
_AGAIN_NS: Final = 10 * NS_PER_S


def texts(reader: Subscription | None) -> list[Any]:
    """Return all that has come on a topic of JSON."""
    found = []
    while reader is not None and reader.take():
        found.append(json.loads(str(reader.msg.data)))
    return found


def say(publisher: Publisher | None, text: str, now_ns: int) -> None:
    """Publish a text, if somebody would read it."""
    if publisher is not None:
        publisher.msg.data = text
        publisher.publish(now_ns)


class Later:
    """Does things at their times, in order."""

    def __init__(self) -> None:
        self._waiting: list[tuple[int, int, Callable[[int], None]]] = []
        self._count = 0

    def at(self, time_ns: int, do: Callable[[int], None]) -> None:
        """Have something done at a time; it is called with the time."""
        self._count += 1
        self._waiting.append((time_ns, self._count, do))
        self._waiting.sort()

    def act(self, now_ns: int) -> None:
        """Do what is due."""
        while self._waiting and self._waiting[0][0] <= now_ns:
            self._waiting.pop(0)[2](now_ns)

    def forget(self) -> None:
        """Do nothing of it."""
        self._waiting.clear()


class Disk:
    """
    Plays the device ``journal``: the real file, on a disk in memory that survives the core.

    :ivar full: there is room only for what it had kept free.
    """

    def __init__(self) -> None:
        self.full = False
        self._store = MemoryStore()
        self._later = Later()

    def enter(self, stage: Stage) -> None:
        """Begin with a new core, which knows nothing."""
        self._later.forget()
        self._records = stage.reader('alarms/journal')
        self._stored = stage.publisher('alarms/stored')
        self._journal: JournalFile | None = None
        self._open_ns = self._now_ns = 0
        self._low = False

    def act(self, now_ns: int) -> None:
        """Give back what is kept, then write what comes."""
        self._now_ns = now_ns
        self._store.room = 0 if self.full else _DISK_BYTES
        if self._journal is None and now_ns >= self._open_ns:
            self._open(now_ns)
        for record in texts(self._records):
            if self._journal is not None:  # else it is asked for again
                self._later.at(now_ns + _DISK_NS, partial(self._keep, record))
        self._later.act(now_ns)
        if now_ns % NS_PER_S == 0 and self._journal is not None:
            self._look(self._journal.keep_room(), now_ns)

    def _open(self, now_ns: int) -> None:
        journal = JournalFile(self._store, _JOURNAL_BYTES, lambda: self._now_ns)
        try:
            living = journal.open().living()
        except OSError as error:
            self._fail(error, now_ns)
            return
        self._journal = journal
        for each in living:
            self._answer({'record': each.record, 'age_ns': now_ns - each.at_ns}, now_ns)
        self._answer({'restored': len(living)}, now_ns)

    def _keep(self, record: dict[str, Any], now_ns: int) -> None:
        if self._journal is None:
            return
        try:
            self._journal.append(compact(record), int(record['seq']))
            self._answer({'stored': self._journal.commit()}, now_ns)
        except OSError as error:
            self._fail(error, now_ns)

    def _look(self, room: DiskReserve, now_ns: int) -> None:
        if self._low != (room.problem is not None):
            self._low = not self._low
            self._answer({'low': str(room.problem.strerror) if room.problem else ''}, now_ns)

    def _fail(self, error: OSError, now_ns: int) -> None:
        self._journal, self._open_ns = None, now_ns + _RETRY_NS
        self._answer({'fault': str(error.strerror)}, now_ns)

    def _answer(self, content: Mapping[str, Any], now_ns: int) -> None:
        say(self._stored, json.dumps(content), now_ns)


class Channels:
    """
    Plays the program ``notifier``, and the carer who reads what it brings.

    :param carer: how quick they are.
    :ivar failing: no message gets through.
    :ivar shown: dedup key -> how often a person saw it.
    :ivar told: number of messages by the alarm's id.
    """

    def __init__(self, carer: Carer, random: Random) -> None:
        self.failing = False
        self.shown: dict[str, int] = {}
        self.told: dict[str, int] = {}
        self._carer, self._random = carer, random
        self._later = Later()
        self._busy: set[str] = set()
        self._done: dict[str, dict[str, Any]] = {}

    def enter(self, stage: Stage) -> None:
        """Find the topics; the carer forgets nothing when a core dies."""
        self._messages = stage.reader('alarms/notify')
        self._reports = stage.publisher('alarms/report')
        self._commands = stage.publisher('alarms/command')
        self._beats = stage.publisher('notifier/heartbeat')

    def act(self, now_ns: int) -> None:
        """Bring messages, and do what is due; it is alive all the time."""
        if now_ns % _BEAT_NS == 0:
            say(self._beats, '{}', now_ns)
        for message in texts(self._messages):
            key = message['key']
            if key in self._done:  # it was sent again
                say(self._reports, json.dumps(self._done[key]), now_ns)
            else:
                self._later.at(now_ns + _CHANNEL_NS, partial(self._bring, message))
        self._later.act(now_ns)

    def _bring(self, message: dict[str, Any], now_ns: int) -> None:
        key = message['key']
        report = {'key': key, 'channel': message['channel'], 'ok': not self.failing,
                  'text': 'no network' if self.failing else 'delivered'}
        say(self._reports, json.dumps(report), now_ns)
        if self.failing:
            return
        if key not in self._done:
            self._done[key] = report
            self.shown[key] = self.shown.get(key, 0) + 1
            alarm = str(message['alarm'])
            self.told[alarm] = self.told.get(alarm, 0) + 1
            self._read(alarm, now_ns)

    def _read(self, alarm: str, now_ns: int) -> None:
        if alarm in self._busy or not math.isfinite(self._carer.reads_after_s):
            return
        self._busy.add(alarm)
        self._later.at(now_ns + round(self._carer.reads_after_s * NS_PER_S),
                       partial(self._acknowledge, alarm))

    def _acknowledge(self, alarm: str, now_ns: int) -> None:
        say(self._commands, f'acknowledge {alarm} by {CARER}', now_ns)
        self._later.at(now_ns + round(self._carer.ends_after_s * NS_PER_S),
                       partial(self._end, alarm))

    def _end(self, alarm: str, now_ns: int) -> None:
        say(self._commands, f'resolve {alarm} by {CARER} looked after', now_ns)
        self._busy.discard(alarm)  # what comes again is looked at again


class Operator:
    """
    Plays an operator at a screen, and another program that calls for somebody.

    :param body: of the robot, which they send elsewhere.
    """

    def __init__(self, body: Body) -> None:
        self._body = body
        self._texts: dict[str, Publisher | None] = {}
        self._calls: dict[str, int] = {}

    def enter(self, stage: Stage) -> None:
        """Find the topics."""
        self._texts = {topic: stage.publisher(topic)
                       for topic in ('agent/command', 'alarms/causes')}
        self._goal = stage.publisher('goal_pose')

    def act(self, now_ns: int) -> None:
        """Say again what lasts."""
        for caller, until_ns in self._calls.items():
            if now_ns % _AGAIN_NS == 0 and now_ns < until_ns:
                self._call(caller, True, now_ns)

    def order(self, words: str, now_ns: int) -> None:
        """Say something to the agent."""
        say(self._texts['agent/command'], words, now_ns)

    def send(self, x: float, y: float, now_ns: int) -> None:
        """Send the robot elsewhere."""
        if self._goal is not None:
            self._body.errand = x, y
            self._goal.msg.pose.position = x, y, 0.0
            self._goal.msg.pose.orientation = 0.0, 0.0, 0.0, 1.0
            self._goal.publish(now_ns)

    def call(self, caller: str, for_ns: int, now_ns: int) -> None:
        """Have another program call for somebody, for a while."""
        self._calls[caller] = now_ns + for_ns
        self._call(caller, True, now_ns)

    def hang_up(self, caller: str, now_ns: int) -> None:
        """End a call."""
        self._call(caller, False, now_ns)

    def _call(self, caller: str, active: bool, now_ns: int) -> None:
        place = CALLERS[caller]
        say(self._texts['alarms/causes'], json.dumps({
            'kind': 'call', 'subject': caller, 'level': 'urgent', 'active': active,
            'text': f'a call from the {caller}', 'source': 'calls',
            **({} if place is None else {'x': place[0], 'y': place[1]})}), now_ns)
