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

"""Read a recording sequentially, as far as it is intact, and report the rest."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import Attachment
from mcap.records import Channel
from mcap.records import Metadata
from mcap.records import Schema

from rt_robot_os.base.errors import RecordingError
from rt_robot_os.recording.bag_file import REPLAY
from rt_robot_os.recording.bag_info import CORE_TOPIC
from rt_robot_os.recording.bag_info import TopicFacts
from rt_robot_os.recording.mcap_records import chunk_records
from rt_robot_os.recording.mcap_records import DamagedRecordError
from rt_robot_os.recording.mcap_records import file_records
from rt_robot_os.recording.mcap_records import Message
from rt_robot_os.recording.mcap_records import parsed
from rt_robot_os.recording.mcap_records import RECORD
from rt_robot_os.recording.mcap_records import summary_definitions
from rt_robot_os.recording.mcap_records import unpacked
from rt_robot_os.recording.repair import bag_files
from rt_robot_os.recording.session import CLOCK
from rt_robot_os.recording.session import moment_ns
from rt_robot_os.recording.session import SESSION
from rt_robot_os.recording.session import SessionFacts
from rt_robot_os.recording.session import SETTINGS


@dataclass(frozen=True)
class Recorded:
    """
    A recorded sample.

    :ivar topic: in the core.
    :ivar log_ns: time of day of its data.
    :ivar offset_ns: from CLOCK_MONOTONIC to the time of day, at that time.
    :ivar before_ns: log time of the previous sample of this topic; 0 if there is none.
    """

    topic: str
    number: int
    log_ns: int
    offset_ns: int
    before_ns: int
    cdr: bytes

    @property
    def stamp_ns(self) -> int:
        """On CLOCK_MONOTONIC."""
        return self.log_ns - self.offset_ns


class Recording:
    """
    One session of a recording.

    :param path: a folder, or one file.
    :param session: its number; None for the first one.
    :raises RecordingError: nothing can be read, or there is no such session.
    :ivar facts: of the session.
    :ivar settings: as JSON; None if there are none.
    :ivar problems: descriptions of what could not be read.
    :ivar topics: the bag topics read so far, by their names in the core.
    """

    def __init__(self, path: Path, session: int | None = None) -> None:
        self.problems: list[str] = []
        self.settings: str | None = None
        self.topics: dict[str, TopicFacts] = {}
        self._offset_ns = 0
        self._files: list[Path] = []
        self.facts = self._find(bag_files(path), session)

    def _find(self, files: list[Path], wanted: int | None) -> SessionFacts:
        """Find the files of the session by their metadata."""
        chosen: SessionFacts | None = None
        others = set()
        for file in files:
            facts, settings = beginning_of(file, self.problems)
            if facts is None:
                self.problems.append(f'{file}: not a recording of record; skipped')
                continue
            if chosen is None and wanted in (None, facts.number):
                chosen, self.settings = facts, settings
            if chosen is not None and facts.number == chosen.number:
                self._files.append(file)
            else:
                others.add(facts.number)
        if chosen is None:
            if wanted is not None and others:
                raise RecordingError(f'there is no session {wanted}; known are '
                                     f'{", ".join(map(str, sorted(others)))}')
            raise RecordingError('\n'.join(self.problems) or 'nothing to read')
        if others:
            self.problems.append(
                f'this is session {chosen.number}; the core was restarted during the recording: '
                f'for the others choose --session {", ".join(map(str, sorted(others)))}')
        return chosen

    def samples(self) -> Iterator[Recorded]:
        """Yield all samples in the order of reception."""
        self._offset_ns = self.facts.offset_ns
        before: dict[str, int] = {}
        for file in self._files:
            for topic, message in self._messages(file):
                yield Recorded(topic, message.sequence, message.publish_ns, self._offset_ns,
                               before.get(topic, 0), message.data)
                before[topic] = message.publish_ns

    def _messages(self, file: Path) -> Iterator[tuple[str, Message]]:
        """Yield the messages of the intact part of a file, with their topics in the core."""
        shown, kept = _Channels(self.facts.form), _Channels(0)
        shown.define(*summary_definitions(file))
        try:
            for _, kind, content in file_records(file):
                if kind == Opcode.DATA_END:
                    return
                if kind == Opcode.CHUNK:
                    yield from shown.messages(content)
                    self.topics.update(shown.facts)
                elif kind == Opcode.ATTACHMENT:
                    attachment = parsed(Attachment.read, content)
                    if attachment.name == REPLAY:
                        yield from kept.messages(attachment.data[RECORD.size:])
                elif kind == Opcode.METADATA:
                    self._read_offset(parsed(Metadata.read, content))
        except DamagedRecordError as error:
            self.problems.append(f'{file} is damaged: read up to the damage; repair it with '
                                 f'record --repair ({error})')
        except OSError as error:
            if isinstance(error, RecordingError):
                raise
            self.problems.append(f'{file} cannot be read: {error.strerror}')
        else:
            self.problems.append(f'{file} is truncated: read up to its end; repair it with '
                                 'record --repair')

    def _read_offset(self, metadata: Metadata) -> None:
        if metadata.name == CLOCK:
            try:
                self._offset_ns = moment_ns(metadata.metadata['offset_ns'])
            except (KeyError, ValueError) as error:
                raise DamagedRecordError(f'no clock offset: {error}') from error
        elif metadata.name == SESSION:
            self._offset_ns = SessionFacts.read(metadata.metadata).offset_ns


def beginning_of(file: Path, problems: list[str]) -> tuple[SessionFacts | None, str | None]:
    """
    Read the session and the settings at the beginning of a file.

    :param problems: a sentence is added if the beginning is damaged.
    :return: its session, None if it is not a recording of record; its settings, None without them.
    :raises RecordingError: it cannot be read.
    """
    facts = None
    try:
        for _, kind, content in file_records(file):
            if kind == Opcode.METADATA:
                metadata = parsed(Metadata.read, content)
                if metadata.name == SESSION:
                    facts = SessionFacts.read(metadata.metadata)
            elif kind == Opcode.ATTACHMENT:
                attachment = parsed(Attachment.read, content)
                if attachment.name == SETTINGS:
                    return facts, attachment.data.decode('utf-8', 'replace')
            elif kind in (Opcode.CHUNK, Opcode.MESSAGE, Opcode.DATA_END):
                break
    except DamagedRecordError as error:
        problems.append(f'{file} is damaged at its beginning: {error}')
    except OSError as error:
        if isinstance(error, RecordingError):
            raise
        raise RecordingError(f'{file} cannot be read: {error.strerror}') from error
    return facts, None


class _Channels:
    """
    The channels of a file, or of its data for a replay.

    :param form: of the recording; 0 for replay data, whose topics are those of the core.
    :ivar facts: the bag topics, by their names in the core.
    """

    def __init__(self, form: int) -> None:
        self.facts: dict[str, TopicFacts] = {}
        self._form = form
        self._topics: dict[int, str] = {}
        self._schemas: dict[int, str] = {}

    def define(self, schemas: Mapping[int, Schema], channels: Mapping[int, Channel]) -> None:
        """Add definitions from the summary: the chunk with the definition may be lost."""
        for schema in schemas.values():
            self._schemas[schema.id] = schema.name
        for channel in channels.values():
            self._define(channel)

    def messages(self, content: bytes) -> Iterator[tuple[str, Message]]:
        """
        Yield the messages of a chunk with their topics in the core; others are skipped.

        :raises DamagedRecordError: it is damaged.
        """
        topics = self._topics
        for record in chunk_records(unpacked(content)):
            if isinstance(record, Message):
                topic = topics.get(record.channel)
                if topic:
                    yield topic, record
            elif isinstance(record, Channel):
                self._define(record)
            elif isinstance(record, Schema):
                self._schemas[record.id] = record.name

    def _define(self, channel: Channel) -> None:
        name = channel.topic
        if self._form == 1:
            name = name.lstrip('/')
        elif self._form > 1:
            name = channel.metadata.get(CORE_TOPIC, '')
        self._topics[channel.id] = name
        if name and self._form:
            self.facts[name] = TopicFacts.read(
                channel.topic, self._schemas.get(channel.schema_id, ''), channel.metadata)
