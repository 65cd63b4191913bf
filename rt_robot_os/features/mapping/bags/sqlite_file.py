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

"""An SQLite file as a bag of ROS 2, the format of `ros2 bag` before MCAP."""

from __future__ import annotations

from collections.abc import Collection
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
import sqlite3
from typing import Any
from typing import Final
from urllib.parse import quote

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.mapping.bags.storage import BagMessage
from rt_robot_os.features.mapping.bags.storage import CDR
from rt_robot_os.features.mapping.bags.storage import Findings
from rt_robot_os.features.mapping.bags.storage import whole_message

#: Messages that are skipped at a damaged place; the number doubles each time.
_JUMP: Final = 16
_MOST: Final = 1 << 40


class SqliteFile:
    """
    One file of SQLite.

    :raises ConfigError: it is not SQLite, or not a bag.
    """

    def __init__(self, path: Path, findings: Findings) -> None:
        self._path = path
        self._findings = findings
        self._before = findings.read_bytes
        self._size = path.stat().st_size
        self._topics: dict[int, str] = {}
        try:
            with closing(self._opened()) as bag:
                for number, name, kind, form in bag.execute(
                        'SELECT id, name, type, serialization_format FROM topics'):
                    if form == CDR:
                        self._topics[number] = str(name)
                    findings.types.setdefault(
                        str(name), str(kind) if form == CDR else f'{kind} as {form}')
        except sqlite3.Error as error:
            raise ConfigError([f'{path}: not a readable bag of ROS 2: {error}']) from error

    def _opened(self) -> sqlite3.Connection:
        # A bag that was not closed has its newest messages in a separate journal.
        journal = self._path.with_name(self._path.name + '-wal')
        mode = 'mode=ro' if journal.exists() else 'immutable=1'
        bag = sqlite3.connect(f'file:{quote(str(self._path.absolute()))}?{mode}', uri=True)
        # Otherwise a truncated file is not read at all.
        bag.execute('PRAGMA writable_schema = ON')
        return bag

    def messages(self, topics: Collection[str]) -> Iterator[BagMessage]:
        """Yield the messages of some topics in their order, as far as they can be read."""
        wanted = [number for number, name in self._topics.items() if name in topics]
        first, jump, error = 0, _JUMP, None
        with closing(self._opened()) as bag:
            last = _last(bag)
            while first <= last:
                number = first - 1
                try:
                    for number, topic, log_ns, data in bag.execute(
                            'SELECT id, topic_id, timestamp, data FROM messages WHERE id >= ? AND '
                            f'topic_id IN ({",".join("?" * len(wanted))}) ORDER BY id',
                            (first, *wanted)):
                        self._progress(number / max(1, last))
                        yield from self._message(topic, log_ns, data)
                    break
                except sqlite3.Error as found:
                    # A page is lost; there may be intact ones after it.
                    jump, error = (_JUMP if number >= first else 2 * jump), error or found
                    first = number + jump
        if error is not None:
            self._findings.problems.append(
                f'{self._path} is damaged or truncated: its readable part is used ({error})')

    def _message(self, topic: int, log_ns: Any, data: Any) -> Iterator[BagMessage]:
        try:
            yield BagMessage(self._topics[topic], int(log_ns), whole_message(bytes(data)))
        except (ValueError, TypeError):
            self._findings.lost += 1

    def _progress(self, share: float) -> None:
        self._findings.read_bytes = self._before + round(self._size * min(1.0, share))


def _last(bag: sqlite3.Connection) -> int:
    """Return the highest number of a message, or a larger number when it is unknown."""
    try:
        return int(bag.execute('SELECT max(id) FROM messages').fetchone()[0] or 0)
    except (sqlite3.Error, TypeError, ValueError):
        return _MOST
