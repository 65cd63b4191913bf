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

"""Rows in memory that could not be written to the disk yet; they are sent meanwhile."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from rt_robot_os.gateway.outbox import Mark
from rt_robot_os.gateway.outbox import OutboxPosition
from rt_robot_os.gateway.outbox import OutboxRow
from rt_robot_os.messages.uplink.importance import Importance

#: Most rows; beyond that the oldest of the least important are evicted.
ROWS_MOST: Final = 4096


class MemoryFallback:
    """
    A bounded table in memory.

    :ivar marks: how far topics have been recorded, to be written with the rows.
    """

    def __init__(self) -> None:
        self.marks: dict[str, Mark] = {}
        self._rows: dict[tuple[int, int, int], OutboxRow] = {}

    def __len__(self) -> int:
        return len(self._rows)

    def add(self, rows: Sequence[OutboxRow], marks: Sequence[Mark]) -> list[OutboxRow]:
        """
        Hold rows.

        :return: those that were evicted.
        """
        for row in rows:
            self._rows[row[:3]] = row
        self.marks.update((mark.topic, mark) for mark in marks)
        gone = []
        while len(self._rows) > ROWS_MOST:
            worst = max(key[0] for key in self._rows)
            gone.append(self._rows.pop(min(key for key in self._rows if key[0] == worst)))
        return gone

    def rows(self) -> list[OutboxRow]:
        """Return all rows, the most important and oldest first."""
        return [self._rows[key] for key in sorted(self._rows)]

    def after(self, importance: Importance, place: OutboxPosition, most: int, most_bytes: int
              ) -> list[OutboxRow]:
        """Return the oldest rows after a position, like :meth:`.outbox.Outbox.after`."""
        found: list[OutboxRow] = []
        size = 0
        for key in sorted(key for key in self._rows if key[0] == importance and key[1:] > place):
            size += self._rows[key].nbytes
            if found and (size > most_bytes or key[1] != found[0].boot):
                break
            found.append(self._rows[key])
            if len(found) == most:
                break
        return found

    def done(self, rows: Sequence[OutboxRow]) -> None:
        """Remove rows."""
        if self._rows:
            for row in rows:
                self._rows.pop(row[:3], None)

    def clear(self) -> None:
        """Remove everything: it is on the disk."""
        self._rows.clear()
        self.marks.clear()
