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

"""An MCAP file as a bag of ROS 2: chunked or not, also truncated or damaged."""

from __future__ import annotations

from collections.abc import Collection
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from mcap.opcode import Opcode
from mcap.records import Channel
from mcap.records import Schema

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import RecordingError
from rt_robot_os.features.mapping.bags.storage import BagMessage
from rt_robot_os.features.mapping.bags.storage import CDR
from rt_robot_os.features.mapping.bags.storage import Findings
from rt_robot_os.features.mapping.bags.storage import whole_message
from rt_robot_os.recording.mcap_records import chunk_records
from rt_robot_os.recording.mcap_records import DamagedRecordError
from rt_robot_os.recording.mcap_records import file_records
from rt_robot_os.recording.mcap_records import MESSAGE
from rt_robot_os.recording.mcap_records import Message
from rt_robot_os.recording.mcap_records import parsed
from rt_robot_os.recording.mcap_records import summary_definitions
from rt_robot_os.recording.mcap_records import unpacked

#: Beginning of a file without a summary that is searched for its topics.
_BEGINNING_BYTES: Final = 64 << 20


class McapFile:
    """
    One file of MCAP.

    :raises ConfigError: it is malformed, or cannot be read.
    """

    def __init__(self, path: Path, findings: Findings) -> None:
        self._path = path
        self._findings = findings
        self._schemas: dict[int, str] = {}
        self._topics: dict[int, str] = {}
        self._before = findings.read_bytes
        schemas, channels = summary_definitions(path)
        for schema in schemas.values():
            self._define(schema)
        for channel in channels.values():
            self._define(channel)
        if not self._topics:
            before = len(findings.problems), findings.lost
            for _ in self._records(_BEGINNING_BYTES):
                pass  # definitions are collected while reading
            del findings.problems[before[0]:]  # they are reported when the file is read
            findings.lost = before[1]

    def messages(self, topics: Collection[str]) -> Iterator[BagMessage]:
        """Yield the messages of some topics, as far as the file is intact."""
        for message in self._records(None):
            topic = self._topics.get(message.channel, '')
            if topic in topics:
                try:
                    yield BagMessage(topic, message.log_ns, whole_message(message.data))
                except ValueError:
                    self._findings.lost += 1

    def _records(self, most_bytes: int | None) -> Iterator[Message]:
        """Yield all messages, and record what cannot be read."""
        findings, damaged = self._findings, 0
        try:
            for offset, kind, content in file_records(self._path):
                findings.read_bytes = self._before + offset + len(content)
                if kind == Opcode.DATA_END:
                    break
                if most_bytes is not None and offset > most_bytes:
                    return
                try:
                    yield from self._messages(kind, content)
                except DamagedRecordError:
                    damaged += 1
            else:
                findings.problems.append(f'{self._path} is truncated: it was read up to there')
        except DamagedRecordError as error:
            findings.problems.append(f'{self._path} is damaged: it was read up to there ({error})')
        except RecordingError as error:
            raise ConfigError([str(error)]) from error
        except OSError as error:
            findings.problems.append(f'{self._path} cannot be read to its end: {error.strerror}')
        if damaged:
            findings.problems.append(f'{self._path}: {damaged} damaged records were skipped')

    def _messages(self, kind: int, content: bytes) -> Iterator[Message]:
        if kind == Opcode.CHUNK:
            for record in chunk_records(unpacked(content)):
                if isinstance(record, Message):
                    yield record
                else:
                    self._define(record)
        elif kind == Opcode.MESSAGE:
            if len(content) < MESSAGE.size:
                raise DamagedRecordError(f'a message of {len(content)} bytes')
            channel, sequence, log_ns, publish_ns = MESSAGE.unpack_from(content)
            yield Message(channel, sequence, log_ns, publish_ns, content[MESSAGE.size:], 0)
        elif kind == Opcode.SCHEMA:
            self._define(parsed(Schema.read, content))
        elif kind == Opcode.CHANNEL:
            self._define(parsed(Channel.read, content))

    def _define(self, record: Schema | Channel) -> None:
        if isinstance(record, Schema):
            self._schemas[record.id] = record.name
            return
        kind = self._schemas.get(record.schema_id, '')
        if record.message_encoding != CDR:
            kind = f'{kind} as {record.message_encoding}'
        else:
            self._topics[record.id] = record.topic
        self._findings.types.setdefault(record.topic, kind)
