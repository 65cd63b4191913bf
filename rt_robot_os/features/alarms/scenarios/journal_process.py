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
A simulated process that writes the journal: the real files, on a disk in memory.

The disk can be full, and can be cut at any byte. What the process has under way dies with it.
"""

from __future__ import annotations

from collections.abc import Callable
import json
from random import Random
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.alarms.journal_file import JournalFile
from rt_robot_os.features.alarms.journal_store import Killed
from rt_robot_os.features.alarms.journal_store import MemoryStore
from rt_robot_os.sim.scenarios.timeline import Action
from rt_robot_os.sim.scenarios.timeline import VirtualTimeline

#: Short, so that a new file is begun often.
LIMIT_BYTES: Final = 40_000
_RETRY_S: Final = (1.0, 5.0)


def _never() -> None:
    """Handle a kill that no scenario injects."""


class JournalProcess:
    """
    The process that writes the journal, for one run of a core.

    :param store: the disk.
    :param answer: receives what the process sends to the core.
    :param killed: is called when the process is killed in the middle of a write.
    :param limit_bytes: size of a file.
    """

    def __init__(self, timeline: VirtualTimeline, random: Random, store: MemoryStore,
                 answer: Callable[[dict[str, Any]], None], killed: Action = _never,
                 limit_bytes: int = LIMIT_BYTES) -> None:
        self.ended = False
        self._timeline = timeline
        self._random = random
        self._store = store
        self._answer = answer
        self._killed = killed
        self._limit_bytes = limit_bytes
        self._file: JournalFile | None = None
        self._waiting: list[str] = []
        self._low = False
        timeline.after(self._ms(2, 30), self._open)

    def _ms(self, least: float, most: float) -> int:
        return round(self._random.uniform(least, most) * NS_PER_MS)

    def write(self, text: str) -> None:
        """Queue a record; the core sends those again that come before the file is open."""
        if self._file is None:
            return
        if not self._waiting:
            self._timeline.after(self._ms(0.2, 3), self._commit)
        self._waiting.append(text)

    def _open(self) -> None:
        if self.ended:
            return
        now_ns = self._timeline.now_ns
        try:
            file = JournalFile(self._store, self._limit_bytes, lambda: self._timeline.now_ns)
            found = file.open()
        except OSError as error:
            self._fail(str(error.strerror))
            return
        except Killed:
            self._killed()
            return
        self._file = file
        for each in found.living():
            self._answer({'record': each.record, 'age_ns': max(0, now_ns - each.at_ns)})
        self._answer({'restored': len(found.living())})

    def _commit(self) -> None:
        if self.ended or self._file is None:
            return
        waiting, self._waiting = self._waiting, []
        try:
            for text in waiting:
                self._file.append(text, int(json.loads(text)['seq']))
            stored = self._file.commit()
            problem = self._file.keep_room().problem
        except OSError as error:
            self._fail(str(error.strerror))
            return
        except Killed:
            self._killed()
            return
        self._timeline.after(self._ms(0.5, 15), lambda: self._send({'stored': stored}))
        self._report_room(problem)

    def check_room(self) -> None:
        """Check whether the disk is full, as the process does every second."""
        if not self.ended and self._file is not None:
            self._report_room(self._file.keep_room().problem)

    def _report_room(self, problem: OSError | None) -> None:
        if self._low != (problem is not None):
            self._low = not self._low
            self._send({'low': str(problem.strerror) if problem else ''})

    def _send(self, content: dict[str, Any]) -> None:
        if not self.ended:
            self._answer(content)

    def _fail(self, why: str) -> None:
        """Report the fault, and open again after a while."""
        self._file, self._waiting = None, []
        self._timeline.after(round(self._random.uniform(*_RETRY_S) * NS_PER_S), self._open)
        self._answer({'fault': why})
