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
Repair files that are truncated or damaged, after a crash, a full disk, or a removed card.

Complete records stay, an incomplete one at the end is removed, damaged ones in the middle are
marked to be skipped, and the summary at the end is rewritten. This is done in place, because a
full disk has no space for a copy.
"""

from __future__ import annotations

from io import FileIO
from pathlib import Path

from rt_robot_os.base.errors import RecordingError
from rt_robot_os.recording.bag_info import FileFacts
from rt_robot_os.recording.bag_info import METADATA
from rt_robot_os.recording.bag_info import TopicFacts
from rt_robot_os.recording.bag_info import write_bag_info
from rt_robot_os.recording.scan import header
from rt_robot_os.recording.scan import scan
from rt_robot_os.recording.summary import Contents
from rt_robot_os.recording.summary import summary


def repair_file(path: Path) -> str:
    """
    Repair a file in place.

    :return: a description of the repair; empty if none was needed.
    :raises RecordingError: it cannot be repaired.
    """
    found = scan(path)
    if found.whole:
        return ''
    size = path.stat().st_size
    try:
        with path.open('r+b', buffering=0) as file:
            for offset, data in found.patches:
                file.seek(offset)
                _write(file, data[:max(0, found.end - offset)])
            while True:
                end, indices = _end_of(found)
                if not found.has_header:
                    indices = header()
                tail = indices + summary(found, end + len(indices))
                file.truncate(end)
                file.seek(end)
                try:
                    _write(file, tail)
                    break
                except OSError:
                    if not found.chunks:
                        raise
                    # No space even for the summary: the last chunk is removed.
                    found.end = found.chunks.pop()[0].chunk_start_offset
                    file.truncate(end)
                    found.metadata = [m for m in found.metadata if m.offset < found.end]
                    found.attachments = [a for a in found.attachments if a.offset < found.end]
    except OSError as error:
        raise RecordingError(f'{path} cannot be repaired: {error.strerror}') from error
    skipped = (f', {found.damaged} damaged {"record" if found.damaged == 1 else "records"} '
               'skipped' if found.damaged else '')
    return f'{max(0, size - end)} bytes at its end were removed{skipped}'


def _write(file: FileIO, data: bytes) -> None:
    left = memoryview(data)
    while left:
        left = left[file.write(left):]


def _end_of(found: Contents) -> tuple[int, bytes]:
    """Return the end of the data, and the indices of the last chunk if they are incomplete."""
    if found.chunks:
        index, _, written = found.chunks[-1]
        after = index.chunk_start_offset + index.chunk_length
        if after <= found.end < after + len(written):
            return after, written
    return found.end, b''


def file_facts(path: Path) -> FileFacts:
    """
    Return the facts of a file for ``metadata.yaml``.

    :raises RecordingError: as for :func:`scan`.
    """
    found = scan(path)
    facts = FileFacts(path.name)
    facts.first_ns, facts.last_ns = found.times_ns()
    counts = found.counts()
    for number, channel in found.channels.items():
        schema = found.schemas.get(channel.schema_id)
        topic = TopicFacts.read(channel.topic, schema.name if schema is not None else '',
                                channel.metadata)
        facts.counts[topic] = facts.counts.get(topic, 0) + counts.get(number, 0)
    return facts


def bag_files(path: Path) -> list[Path]:
    """
    List the files of a recording in order.

    :param path: a folder, or one file.
    :raises RecordingError: there is none.
    """
    if not path.is_dir():
        if not path.exists():
            raise RecordingError(f'{path} does not exist')
        return [path]

    def number(file: Path) -> tuple[int, str]:
        digits = file.stem.rpartition('_')[2]
        return (int(digits) if digits.isdigit() else -1, file.name)

    found = sorted(path.glob('*.mcap'), key=number)
    if not found:
        raise RecordingError(f'{path} holds no .mcap file')
    return found


def repair_all(path: Path) -> tuple[list[str], list[str]]:
    """
    Repair all files of a recording and rewrite its ``metadata.yaml``.

    :param path: a folder, or one file of it.
    :return: the results, one line per file; the failures.
    :raises RecordingError: there is no file, or its folder cannot be written.
    """
    lines, failed, facts = [], [], []
    for file in bag_files(path):
        try:
            done = repair_file(file)
            lines.append(f'{file}: repaired, {done}' if done else f'{file}: intact')
        except RecordingError as error:
            failed.append(str(error))
    folder = path if path.is_dir() else path.parent
    if path.is_dir() or (folder / METADATA).exists():
        for file in bag_files(folder):
            try:
                facts.append(file_facts(file))
            except RecordingError:
                continue  # it is among the failures, or was not to be repaired
        try:
            write_bag_info(folder, facts)
        except OSError as error:
            if isinstance(error, RecordingError):
                raise
            raise RecordingError(f'{folder / METADATA} cannot be written: '
                                 f'{error.strerror}') from error
        lines.append(f'{folder / METADATA}: written')
    return lines, failed
