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

"""The device ``journal`` in scenarios: its process writes the real files, on a disk in memory."""

from __future__ import annotations

from collections.abc import Mapping
import json
from random import Random
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.alarms.journal_store import MemoryStore
from rt_robot_os.features.alarms.scenarios.journal_process import JournalProcess
from rt_robot_os.sim.scenarios.timeline import VirtualTimeline
from rt_robot_os.tools.rehearse.fixture import CoreFixture
from rt_robot_os.tools.rehearse.topics import publish_text
from rt_robot_os.tools.rehearse.topics import received

_DISK_BYTES: Final = 1 << 30
# The default of the device.
_JOURNAL_BYTES: Final = 1 << 20


class JournalDevice:
    """
    Simulates the device; its disk survives a crash of the core.

    :ivar full: the disk is full except for the space reserved by the journal.
    """

    def __init__(self, random: Random) -> None:
        self.full = False
        self._random = random
        self._store = MemoryStore()
        self._timeline = VirtualTimeline()
        self._process: JournalProcess | None = None

    def attach(self, fixture: CoreFixture) -> None:
        """Find the topics of a new core; the process of the last one has ended with it."""
        self._timeline.clear()
        self._process = None
        self._records = fixture.reader('alarms/journal')
        self._stored = fixture.publisher('alarms/stored')

    def step(self, now_ns: int) -> None:
        """Write the received records, and answer."""
        self._store.room = 0 if self.full else _DISK_BYTES
        self._timeline.run_until(now_ns)
        if self._process is None:
            self._process = JournalProcess(self._timeline, self._random, self._store,
                                           self._answer, limit_bytes=_JOURNAL_BYTES)
        for record in received(self._records):
            self._process.write(record)
        if now_ns % NS_PER_S == 0:
            self._process.check_room()

    def _answer(self, content: Mapping[str, Any]) -> None:
        publish_text(self._stored, json.dumps(content), self._timeline.now_ns)
