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

"""A journal with its topics, and the process that writes it."""

from __future__ import annotations

from collections.abc import Callable
import json
from pathlib import Path
import select
import time
from typing import Any

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.features.alarms.journal_device.driver import Journal
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.messages.cause import CAUSES_MESSAGE
from rt_robot_os.testing.fakes import settings_of
from rt_robot_os.topics import Bus


class Rig:
    """A journal with its topics."""

    def __init__(self, folder: Path, **given: Any) -> None:
        kernel = Kernel(VirtualClock())
        bus = Bus(kernel)
        self.device = Journal('journal', settings_of(Journal, port=str(folder), **given))
        (stored,) = self.device.publications()
        bus.add(stored, 4)
        bus.declare('alarms/journal', CAUSES_MESSAGE, tail=33_000, depth=8)
        self.records = bus.publisher('alarms/journal')
        self.device.bind([bus.publisher(stored.topic)])
        self.device.connect(bus, kernel.add_task('journal', lambda: None, priority=20))
        self.stored = bus.subscribe(stored.topic, 'test')
        self.said: list[dict[str, Any]] = []

    def begin(self) -> list[str]:
        """Open it, and give the alarms that it gives back."""
        self.device.open()
        at = len(self.said)
        self.until(lambda: any('restored' in each for each in self.said[at:]))
        return [each['record']['alarm'] for each in self.said[at:] if 'record' in each]

    def until(self, done: Callable[[], object]) -> None:
        deadline = time.monotonic() + 60
        while not self._heard(done):
            assert time.monotonic() < deadline, self.said
            fd = self.device.fileno()
            assert fd is not None
            select.select([fd], [], [], 1.0)
            try:
                self.device.read(time.monotonic_ns())
            except DeviceError:
                self._heard(done)
                raise

    def _heard(self, done: Callable[[], object]) -> object:
        while self.stored.take():
            self.said.append(json.loads(str(self.stored.msg.data)))
        return done()

    def keep(self, seq: int, alarm: str = '', is_open: bool = True, text: str = '') -> None:
        self.records.msg.data = json.dumps({
            'seq': seq, 'alarm': alarm or str(seq), 't_ns': seq, 'events': [text],
            'state': {} if is_open else None, 'lasting': []})
        self.records.publish(seq)
        self.device.receive(seq, False)

    def until_stored(self, seq: int) -> None:
        self.until(lambda: any(each.get('stored', 0) >= seq for each in self.said))


def worker_of(rig: Rig) -> int:
    """Return the process that writes, which noted itself in the lock."""
    return int(json.loads((Path(rig.device.settings['port']) / 'lock').read_text())['pid'])
