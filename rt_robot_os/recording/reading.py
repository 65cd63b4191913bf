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

"""Read a recording from front to end, as far as it is whole, and name what is not."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from mcap.records import Attachment
from mcap.records import Channel
from mcap.records import DataEnd
from mcap.records import McapRecord
from mcap.records import Message
from mcap.records import Metadata
from mcap.stream_reader import StreamReader

from rt_robot_os.errors import RecordingError
from rt_robot_os.recording.repair import bag_files
from rt_robot_os.recording.session import CLOCK
from rt_robot_os.recording.session import SESSION
from rt_robot_os.recording.session import SessionFacts
from rt_robot_os.recording.session import SETTINGS


@dataclass(frozen=True)
class Recorded:
    """
    A recorded sample.

    :ivar topic: in the core, without the slash.
    :ivar log_ns: time of day.
    :ivar offset_ns: from CLOCK_MONOTONIC to the time of day, then.
    :ivar before_ns: log time of the sample before on this topic; 0 when there is none.
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
    :param session: its number; None for the first that is there.
    :raises RecordingError: there is nothing that could be read, or no such session.
    :ivar facts: of the session.
    :ivar settings: as JSON; None when there are none.
    :ivar problems: what could not be read.
    """

    def __init__(self, path: Path, session: int | None = None) -> None:
        self.problems: list[str] = []
        self.settings: str | None = None
        self._files: list[Path] = []
        self.facts = self._find(bag_files(path), session)

    def _find(self, files: list[Path], wanted: int | None) -> SessionFacts:
        """Find the files of the session by what stands at their beginnings."""
        chosen: SessionFacts | None = None
        others = set()
        for file in files:
            facts, settings = self._beginning(file)
            if facts is None:
                self.problems.append(f'{file}: no recording of record; left out')
                continue
            if chosen is None and wanted in (None, facts.number):
                chosen, self.settings = facts, settings
            if chosen is not None and facts.number == chosen.number:
                self._files.append(file)
            else:
                others.add(facts.number)
        if chosen is None:
            if wanted is not None and others:
                raise RecordingError(f'there is no session {wanted}; there are '
                                     f'{", ".join(map(str, sorted(others)))}')
            raise RecordingError('\n'.join(self.problems) or 'nothing to read')
        if others:
            self.problems.append(
                f'this is session {chosen.number}; the core was started again meanwhile: choose '
                f'{", ".join(map(str, sorted(others)))} with --session for the others')
        return chosen

    def _beginning(self, file: Path) -> tuple[SessionFacts | None, str | None]:
        facts = None
        for record in self._records(file, quiet=True):
            if isinstance(record, Metadata) and record.name == SESSION:
                facts = SessionFacts.read(record.metadata)
            elif isinstance(record, Attachment) and record.name == SETTINGS:
                return facts, record.data.decode('utf-8', 'replace')
            elif isinstance(record, Message):
                break
        return facts, None

    def samples(self) -> Iterator[Recorded]:
        """Give all samples in the order in which they were received."""
        offset_ns = self.facts.offset_ns
        before: dict[str, int] = {}
        for file in self._files:
            topics: dict[int, str] = {}
            for record in self._records(file):
                if isinstance(record, Message):
                    topic = topics.get(record.channel_id)
                    if topic is None:
                        continue
                    yield Recorded(topic, record.sequence, record.log_time, offset_ns,
                                   before.get(topic, 0), record.data)
                    before[topic] = record.log_time
                elif isinstance(record, Channel):
                    topics[record.id] = record.topic.lstrip('/')
                elif isinstance(record, Metadata) and record.name == CLOCK:
                    offset_ns = int(record.metadata['offset_ns'])
                elif isinstance(record, Metadata) and record.name == SESSION:
                    offset_ns = SessionFacts.read(record.metadata).offset_ns

    def _records(self, file: Path, quiet: bool = False) -> Iterator[McapRecord]:
        try:
            with file.open('rb') as stream:
                for record in StreamReader(stream, validate_crcs=True).records:
                    if isinstance(record, DataEnd):
                        return
                    yield record
        except OSError as error:
            if isinstance(error, RecordingError):
                raise
            self.problems.append(f'{file} cannot be read: {error.strerror}')
            return
        except Exception as error:  # noqa: B902 - each compression has errors of its own
            if quiet:
                return
            self.problems.append(f'{file} is cut short or damaged ({type(error).__name__}): '
                                 'read up to there; record --repair mends it')
            return
        if not quiet:
            self.problems.append(f'{file} is cut short: read up to there; record --repair mends '
                                 'it')
