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

"""Records, in batches that the server acknowledges once they are on its disk."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping
from dataclasses import dataclass
import json
from typing import Any
from typing import ClassVar
from typing import Final

from rt_robot_os.base.safe_text import safe_line
from rt_robot_os.messages.uplink.fields import is_count
from rt_robot_os.messages.uplink.fields import wrong
from rt_robot_os.messages.uplink.greeting import NAME_CHARACTERS
from rt_robot_os.messages.uplink.importance import Importance
from rt_robot_os.messages.uplink.messages import UplinkMessage

#: Of why a batch was refused.
REASON_CHARACTERS: Final = 200
_CLASSES_MOST: Final = 8
_CLASS_CHARACTERS: Final = 8


@dataclass(frozen=True)
class UplinkRecord:
    """
    A record as a gateway writes it; what a server makes of it is the database's to say.

    :ivar seq: its number in this start of the gateway.
    :ivar type: such as ``alarm_event``.
    """

    seq: int
    importance: Importance
    type: str  # noqa: A003
    utc_ns: int
    content: Mapping[str, Any]

    def to_json(self) -> str:
        """
        Write it.

        :raises ValueError: JSON cannot hold it.
        :raises TypeError: likewise.
        """
        return json.dumps(
            {'seq': self.seq, 'importance': int(self.importance), 'type': self.type,
             'utc_ns': self.utc_ns, 'content': dict(self.content)},
            ensure_ascii=False, allow_nan=False, separators=(',', ':'))


@dataclass(frozen=True)
class RecordBatch(UplinkMessage):
    """
    Records of one start of a gateway.

    :ivar batch: its number on this connection.
    :ivar records: as they came: each is checked by the database, and one that is malformed does
        not hold up the others.
    :ivar boot: the start that made them; None for that of the connection.
    :ivar lost: how many records were dropped at the robot so far, by importance; None for unknown.
    """

    KIND: ClassVar[str] = 'records'

    batch: int | str
    records: tuple[Any, ...]
    boot: str | None = None
    lost: Mapping[str, int] | None = None

    def content(self) -> dict[str, Any]:
        """Return the fields on the wire."""
        return {'batch': self.batch, 'boot': self.boot, 'lost': dict(self.lost or {}),
                'records': list(self.records)}

    def with_records(self, texts: Iterable[str]) -> str:
        """Write it, with records that are JSON already in the place of its own."""
        head = RecordBatch(self.batch, (), self.boot, self.lost).to_json()
        return f'{head[:-2]}{",".join(texts)}]}}'

    @classmethod
    def from_json(cls, message: Mapping[str, Any]) -> RecordBatch:
        """
        Read it.

        :raises ValueError: it has no list of records, or no number.
        """
        records, boot, lost = (message.get(name) for name in ('records', 'boot', 'lost'))
        if not isinstance(records, list):
            raise wrong('records', records, 'a list')
        is_boot = isinstance(boot, str) and 0 < len(boot) <= NAME_CHARACTERS
        counts = None if not isinstance(lost, dict) else {
            str(key)[:_CLASS_CHARACTERS]: each
            for key, each in sorted(lost.items())[:_CLASSES_MOST] if is_count(each)}
        return cls(_batch_in(message), tuple(records), boot if is_boot else None, counts)


@dataclass(frozen=True)
class BatchStored(UplinkMessage):
    """The records of a batch are on the server's disk."""

    KIND: ClassVar[str] = 'stored'

    batch: int | str

    def content(self) -> dict[str, Any]:
        """Return the fields on the wire."""
        return {'batch': self.batch}

    @classmethod
    def from_json(cls, message: Mapping[str, Any]) -> BatchStored:
        """
        Read it.

        :raises ValueError: it names no batch.
        """
        return cls(_batch_in(message))


@dataclass(frozen=True)
class BatchRefused(UplinkMessage):
    """
    A batch was not stored.

    :ivar retry_s: from now until it may come again; 0: the robot chooses.
    """

    KIND: ClassVar[str] = 'refused'

    batch: int | str
    text: str = ''
    retry_s: float = 0.0

    def content(self) -> dict[str, Any]:
        """Return the fields on the wire."""
        return {'batch': self.batch, 'text': self.text, 'retry_s': self.retry_s}

    @classmethod
    def from_json(cls, message: Mapping[str, Any]) -> BatchRefused:
        """
        Read it.

        :raises ValueError: it names no batch.
        """
        retry_s = message.get('retry_s', 0.0)
        is_number = isinstance(retry_s, (int, float)) and not isinstance(retry_s, bool)
        return cls(_batch_in(message),
                   safe_line(str(message.get('text', '')))[:REASON_CHARACTERS],
                   float(retry_s) if is_number else 0.0)


def _batch_in(message: Mapping[str, Any]) -> int | str:
    batch = message.get('batch')
    if not isinstance(batch, (int, str)):
        raise wrong('batch', batch, 'an integer or a string')
    return batch
