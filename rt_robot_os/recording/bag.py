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
A recording: a folder of MCAP files of one robot, with limits on its size.

Not thread-safe: only the writing thread uses it.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
import time
from typing import Final

from rt_robot_os.base.errors import RecordingError
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.link.log_message import LOG_STAMP_OFFSET
from rt_robot_os.link.protocol import Header
from rt_robot_os.link.stamp_mapper import StampMapper
from rt_robot_os.recording.bag_file import BagFile
from rt_robot_os.recording.bag_info import FileFacts
from rt_robot_os.recording.bag_info import TopicFacts
from rt_robot_os.recording.bag_info import write_bag_info
from rt_robot_os.recording.graph import LOG
from rt_robot_os.recording.graph import ShownTopic
from rt_robot_os.recording.graph import STATIC
from rt_robot_os.recording.repair import file_facts
from rt_robot_os.recording.repair import repair_file
from rt_robot_os.recording.session import CLOCK
from rt_robot_os.recording.session import package_version
from rt_robot_os.recording.session import RecordingSession
from rt_robot_os.recording.session import SETTINGS
from rt_robot_os.recording.tracks import Track
from rt_robot_os.settings.static_frames import static_transforms

FLUSH_NS: Final = NS_PER_S
# Two clocks cannot be read at the same time; a smaller difference is not corrected.
_STEP_NS: Final = NS_PER_MS
#: The channel of reports of the core, which have no channel on the link.
LOG_CHANNEL: Final = -1

Packet = tuple[Header, bytearray]


@dataclass(frozen=True)
class Limits:
    """
    The limits on the size of a recording.

    :ivar file_bytes: size at which a new file is started; 0 for one file.
    :ivar files: maximum number of files, the oldest is deleted; 0 keeps all.
    """

    file_bytes: int = 0
    files: int = 0


class Bag:
    """
    Write a recording.

    :param folder: created here; it must not exist.
    :raises RecordingError: it exists or cannot be created.
    :ivar messages: written so far, in all files.
    :ivar removed: number of files that were deleted because of the limit.
    """

    def __init__(self, folder: Path, compression: str = 'zstd', limits: Limits = Limits()
                 ) -> None:
        self.folder = folder
        self.messages = self.removed = 0
        self.mapper = StampMapper()
        self._compression = compression
        self._limits = limits
        self._file: BagFile | None = None
        self._files: list[FileFacts] = []
        self._bytes = self._opened = 0
        self._session: RecordingSession | None = None
        self._tracks: dict[int, Track] = {}
        self._lost: dict[str, int] = {}
        self._refused: dict[str, int] = {}
        self._flushed_ns = 0
        try:
            folder.mkdir(parents=True)
        except OSError as error:
            raise RecordingError(f'{folder} cannot be created: {error.strerror}; choose another '
                                 'with -o') from error

    @property
    def size(self) -> int:
        """Bytes on the disk."""
        return self._bytes + (self._file.size if self._file is not None else 0)

    @property
    def empty(self) -> bool:
        """Whether there is no file."""
        return not self._opened

    @property
    def duration_ns(self) -> int:
        """Time from the first message to the last, in the files that still exist."""
        filled = [file for file in self._files if file.messages]
        return (max((file.last_ns for file in filled), default=0)
                - min((file.first_ns for file in filled), default=0))

    @property
    def silent(self) -> list[str]:
        """Return the requested topics without any message."""
        counts: dict[str, int] = {}
        for file in self._files:
            for facts, count in file.counts.items():
                counts[facts.name] = counts.get(facts.name, 0) + count
        return [name for name, count in counts.items() if not count]

    @property
    def lost(self) -> dict[str, int]:
        """Return the number of lost samples by topic, without zeros."""
        return self._added(self._lost, lambda track: track.lost)

    @property
    def refused(self) -> dict[str, int]:
        """Return the number of samples that could not be converted, by topic of the core."""
        return self._added(self._refused, lambda track: track.refused)

    def _added(self, before: Mapping[str, int], count: Callable[[Track], int]) -> dict[str, int]:
        """Add the counts of this session to those of earlier sessions."""
        found = dict(before)
        for track in tuple(self._tracks.values()):
            if counted := count(track):
                found[track.name] = found.get(track.name, 0) + counted
        return found

    def begin(self, session: RecordingSession) -> None:
        """
        Start a session, with its own file.

        :raises RecordingError: the file cannot be created.
        :raises OSError: the disk is full.
        """
        self.end()
        self._session = session
        infos = dict.fromkeys((*session.shown, *session.kept))
        self._tracks = {
            info.channel: Track(info.name, info.stamp_offset, self.mapper.line(),
                                session.shown.get(info, ())) for info in infos}
        if session.logs:
            self._tracks[LOG_CHANNEL] = Track(
                LOG.name, LOG_STAMP_OFFSET, self.mapper.line(), (ShownTopic(LOG),))
        for track in self._tracks.values():
            # The last sample of a latched topic (transient_local) is included although older.
            latched = any(outlet.latched for outlet in track.outlets)
            track.begin_ns = 0 if latched else session.begin_ns
            track.end_ns = session.end_ns or track.end_ns
            track.not_before_ns = session.begin_ns and session.begin_ns + self.mapper.offset_ns
        self._open_file((session.begin_ns or session.start_ns) + self.mapper.offset_ns)

    def write(self, packets: Sequence[Packet]) -> None:
        """
        Write samples as they were received.

        :raises OSError: the disk is full.
        """
        file, tracks = self._file, self._tracks
        if file is None:
            return
        for head, cdr in packets:
            track = tracks.get(head.channel)
            if track is not None:
                self.messages += track.write(file, head, cdr)

    def tick(self, now_ns: int) -> None:
        """
        Do periodic work: write a chunk each second, start the next file, compare the clocks.

        :raises OSError: the disk is full.
        """
        file = self._file
        if file is None or now_ns - self._flushed_ns < FLUSH_NS:
            return
        self._flushed_ns = now_ns
        file.flush()
        before_ns = self.mapper.offset_ns
        if abs(time.time_ns() - time.monotonic_ns() - before_ns) > _STEP_NS:
            self.mapper.compare()
        if self.mapper.offset_ns != before_ns:
            file.note(CLOCK, {'monotonic_ns': str(now_ns),
                              'offset_ns': str(self.mapper.offset_ns)})
        if 0 < self._limits.file_bytes <= file.size:
            self._close_file()
            self._open_file(file.facts.last_ns)

    def end(self) -> None:
        """
        End the session and its file; may be called twice.

        :raises OSError: the disk is full.
        """
        self._session = None
        self._close_file()
        self._lost, self._refused = self.lost, self.refused
        self._tracks = {}

    def rescue(self) -> str:
        """
        Close after an error: the file is repaired, so that it can be read.

        :return: the result, as a sentence.
        """
        file, self._file = self._file, None
        if file is None:
            return f'{self.folder} holds the recording up to this error'
        file.abandon()
        try:
            repair_file(file.path)
            self._files.append(file_facts(file.path))
            self._info()
        except OSError as error:
            return f'{error}; try record --repair {self.folder} when the disk has space'
        return f'{file.path} is closed and can be read: {self._files[-1].messages} messages'

    # ---- files -------------------------------------------------------------------------------

    def _open_file(self, begin_ns: int) -> None:
        """
        Open the next file of the session.

        It begins with the last messages of latched topics, because earlier files may be deleted.

        :param begin_ns: time of day at which it begins.
        """
        session = self._session
        if session is None:
            return
        name = f'{self.folder.name}_{self._opened}.mcap'
        self._opened += 1
        file = self._file = BagFile(self.folder / name, f'rt_robot_os {package_version()}',
                                    self._compression)
        file.note('rt_robot_os.session', session.facts(self.mapper.offset_ns))
        file.attach(SETTINGS, 'application/json', session.settings.encode())
        if session.frames:
            file.add(file.channel(STATIC), begin_ns, static_transforms(session.frames, begin_ns),
                     0, begin_ns)
            self.messages += 1
        channels: dict[TopicFacts, int] = {}
        for track in self._tracks.values():
            self.messages += track.begin(file, channels, begin_ns)
        for info in session.kept:
            self._tracks[info.channel].kept = file.kept_channel(info.name)
        self._flushed_ns = time.monotonic_ns()
        self._info()

    def _close_file(self) -> None:
        file = self._file
        if file is None:
            return
        file.finish()
        self._file = None
        self._bytes += file.size
        self._files.append(file.facts)
        while 0 < self._limits.files < len(self._files) + (self._session is not None):
            oldest = self.folder / self._files.pop(0).name
            self._bytes -= oldest.stat().st_size
            oldest.unlink()
            self.removed += 1
        self._info()

    def _info(self) -> None:
        file = self._file
        write_bag_info(self.folder, [*self._files, *([file.facts] if file is not None else [])])
