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
The faults of alarm scenarios.

Cores, journals, notifiers and the power fail at random moments, also in the middle of a write;
disks are full; channels are down, or deliver and do not confirm; reports are lost.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from random import Random
from typing import Final
from typing import Protocol

from rt_robot_os.features.alarms.journal_store import MemoryStore
from rt_robot_os.features.alarms.scenarios.emergencies import RECIPIENTS
from rt_robot_os.features.alarms.scenarios.notifier_process import Recipient
from rt_robot_os.sim.scenarios.faults import FaultInjector
from rt_robot_os.sim.scenarios.timeline import VirtualTimeline

# Seconds between two, on average.
_MEAN_S: Final = {'core': 90.0, 'power': 300.0, 'journal': 150.0, 'notifier': 120.0,
                  'disk': 240.0, 'outage': 100.0, 'network': 200.0}
_ROOM_BYTES: Final = 1 << 30


class FaultTarget(Protocol):
    """What faults are injected into; see :class:`.fixture.AlarmFixture`."""

    timeline: VirtualTimeline
    random: Random
    disk: MemoryStore
    memory: MemoryStore
    recipients: Mapping[str, Recipient]

    def lose_power(self) -> None:
        """Lose what was not synced."""

    def end_notifier(self) -> None:
        """End the notifier."""

    def end_core(self) -> None:
        """End the core."""

    def end_journal(self, reopen: bool) -> None:
        """End the process that writes the journal."""


class AlarmFaults:
    """
    Injects the faults.

    :ivar counts: injected faults, by the names of the JSON.
    """

    def __init__(self, fixture: FaultTarget) -> None:
        self.counts: Counter[str] = Counter()
        self._fixture = fixture
        self._random = fixture.random
        self._injector = FaultInjector(fixture.timeline, fixture.random)
        self._network_down = False
        # What ends in the middle of a write: on the disk of the journal, and on the other one.
        self._aimed = {True: 'journal', False: 'notifier'}

    def begin(self) -> None:
        """Plan the first fault of each kind."""
        for fault, mean_s in _MEAN_S.items():
            self._injector.recurring(fault, mean_s, self._inject)

    def loses_report(self) -> bool:
        """Return whether a report to the core is lost, and count it."""
        lost = self._network_down and self._random.random() < 0.7
        self.counts['reports_lost'] += lost
        return lost

    def _inject(self, fault: str) -> None:
        if fault == 'disk':
            self._fill_disks()
        elif fault == 'outage':
            self._break_channel()
        elif fault == 'network':
            self.counts['networks_lost'] += 1
            self._network_down = True
            self._injector.after(2.0, 60.0, self._restore_network)
        else:
            self._kill(fault)

    def _fill_disks(self) -> None:
        self.counts['full_disks'] += 1
        for store in (self._fixture.disk, self._fixture.memory):
            if self._random.random() < 0.7:
                store.room = self._random.randint(0, 3_000)
        self._injector.after(1.0, 60.0, self._free_disks)

    def _free_disks(self) -> None:
        self._fixture.disk.room = self._fixture.memory.room = _ROOM_BYTES

    def _break_channel(self) -> None:
        self.counts['outages'] += 1
        recipient = self._fixture.recipients[self._random.choice(RECIPIENTS)]
        recipient.down, recipient.hangs = self._random.choice(
            ((True, False), (False, True), (True, True)))
        self._injector.after(2.0, 90.0, lambda: self._repair_channel(recipient))

    def _repair_channel(self, recipient: Recipient) -> None:
        recipient.down = recipient.hangs = False

    def _restore_network(self) -> None:
        self._network_down = False

    # ---- kills -------------------------------------------------------------------------------

    def _kill(self, process: str) -> None:
        """End a process: now, or in the middle of one of its next writes."""
        if self._random.random() < 0.3:
            self._end(process)
            return
        on_disk = process != 'notifier' and (process != 'power' or self._random.random() < 0.5)
        store = self._fixture.disk if on_disk else self._fixture.memory
        store.kill_at = store.calls + self._random.randint(1, 12)
        self._aimed[on_disk] = process

    def kill_in_write(self, on_disk: bool) -> None:
        """End what was to be killed in the middle of a write."""
        self.counts['in_a_write'] += 1
        self._end(self._aimed[on_disk])

    def _end(self, process: str) -> None:
        self.counts[f'{process}_killed'] += 1
        if process == 'power':
            self._fixture.lose_power()
        if process in ('notifier', 'power'):
            self._fixture.end_notifier()
        if process in ('core', 'power'):
            self._fixture.end_core()
        if process in ('core', 'power', 'journal'):
            self._fixture.end_journal(reopen=process == 'journal')
