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

"""A bag of ROS 2: one file, or a folder of them in their order."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Collection
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
import tempfile
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import RecordingError
from rt_robot_os.features.mapping.bags.sqlite_file import SqliteFile
from rt_robot_os.features.mapping.bags.storage import BagMessage
from rt_robot_os.features.mapping.bags.storage import Findings
from rt_robot_os.features.mapping.bags.storage import need_zstandard
from rt_robot_os.features.mapping.bags.storage import StorageFile
from rt_robot_os.features.mapping.bags.storage import ZSTD
from rt_robot_os.recording.library import need_mcap
import yaml

METADATA: Final = 'metadata.yaml'
_METADATA_BYTES_MOST: Final = 16 << 20
_MCAP: Final = b'\x89MCAP0\r\n'
_SQLITE: Final = b'SQLite format 3\0'
_ROS_1: Final = b'#ROSBAG V'
_MAGIC_BYTES: Final = 16
_SUFFIXES: Final = ('.mcap', '.db3', '.mcap.zstd', '.db3.zstd')
_FILES_MOST: Final = 10_000


def is_bag(path: Path) -> bool:
    """
    Return whether a path is a ROS bag, by its first bytes; any folder counts as one.

    :raises OSError: it cannot be read.
    """
    return path.is_dir() or _magic(path).startswith((_MCAP, _SQLITE, _ROS_1, ZSTD))


class BagReader:
    """
    A bag.

    :param path: a file or a folder.
    :raises ConfigError: it is not a bag, or needs a library that is missing.
    :ivar findings: its content and problems.
    :ivar files: its files, in their order.
    :ivar size_bytes: of all of them.
    """

    def __init__(self, path: Path) -> None:
        self.findings = Findings()
        self.files = _files_of(path, self.findings) if path.is_dir() else [path]
        self.size_bytes = sum(each.stat().st_size for each in self.files)
        self._openers = [_opener(each) for each in self.files]

    def look(self) -> dict[str, str]:
        """
        Find the topics, in the first file that has any.

        :return: types by name.
        """
        for file, opener in zip(self.files, self._openers):
            if self.findings.types:
                break
            with _plain(file) as plain:
                opener(plain, self.findings)
        return self.findings.types

    def messages(self, topics: Collection[str]) -> Iterator[tuple[Path, BagMessage]]:
        """Yield the messages of some topics with the file that they are in."""
        done = 0
        for file, opener in zip(self.files, self._openers):
            self.findings.read_bytes = done
            with _plain(file) as plain:
                try:
                    opened = opener(plain, self.findings)
                except ConfigError as error:
                    if len(self.files) == 1:
                        raise
                    self.findings.problems.extend(error.problems)
                    continue
                for message in opened.messages(topics):
                    yield file, message
            done += file.stat().st_size


def _magic(path: Path) -> bytes:
    with path.open('rb') as file:
        return file.read(_MAGIC_BYTES)


def _files_of(folder: Path, findings: Findings) -> list[Path]:
    """Return the files that the metadata of a folder names, or else those with their suffixes."""
    named = [folder / each for each in _named(folder, findings)]
    missing = [each.name for each in named if not each.is_file()]
    if missing:
        findings.problems.append(f'{folder}: {METADATA} names {", ".join(missing[:5])}, which '
                                 'is not there')
    found = [each for each in named if each.is_file()]
    if not found:
        found = sorted((each for each in folder.iterdir()
                        if each.name.endswith(_SUFFIXES)), key=_number)
    if not found:
        raise ConfigError([f'{folder}: does not contain a bag of ROS 2: no .mcap or .db3 files'])
    return found[:_FILES_MOST]


def _number(file: Path) -> tuple[int, str]:
    digits = file.name.partition('.')[0].rpartition('_')[2]
    return int(digits) if digits.isdigit() else -1, file.name


def _named(folder: Path, findings: Findings) -> list[str]:
    file = folder / METADATA
    if not file.is_file():
        return []
    try:
        if file.stat().st_size > _METADATA_BYTES_MOST:
            raise ValueError('it is too long')
        about: Any = yaml.safe_load(file.read_text(encoding='utf-8'))
        about = about['rosbag2_bagfile_information']
        for topic in about.get('topics_with_message_count') or ():
            data = topic['topic_metadata']
            findings.types.setdefault(str(data['name']), str(data['type']))
        # Names only: a bag has no paths outside of its folder.
        return [Path(str(each)).name for each in about['relative_file_paths']]
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError,
            yaml.YAMLError) as error:
        text = str(error).splitlines()[0] if str(error) else type(error).__name__
        findings.types.clear()
        findings.problems.append(f'{file} cannot be read ({text}): the files next to it are used')
        return []


def _opener(path: Path) -> Callable[[Path, Findings], StorageFile]:
    """Return the reader of a file, by its name if it is compressed, else by its first bytes."""
    magic = _magic(path)
    if magic.startswith(_ROS_1):
        raise ConfigError([f'{path}: a bag of ROS 1: convert it to ROS 2 (pip install '
                           f'rosbags; rosbags-convert --src {path.name} --dst NEW)'])
    if magic.startswith(ZSTD):
        is_sqlite = path.name.removesuffix('.zstd').endswith('.db3')
    elif magic.startswith((_MCAP, _SQLITE)):
        is_sqlite = magic.startswith(_SQLITE)
    else:
        raise ConfigError([f'{path}: not a bag of ROS 2: it starts neither as MCAP nor as SQLite'])
    if is_sqlite:
        return SqliteFile
    try:
        need_mcap()
    except RecordingError as error:
        raise ConfigError([str(error)]) from error
    from rt_robot_os.features.mapping.bags.mcap_file import McapFile
    return McapFile


@contextmanager
def _plain(path: Path) -> Iterator[Path]:
    """Yield a file unmodified, or a temporary decompressed copy."""
    if not _magic(path).startswith(ZSTD):
        yield path
        return
    zstandard = need_zstandard(f'{path.name} is compressed')
    with tempfile.TemporaryDirectory(prefix='mapping-') as folder:
        plain = Path(folder) / path.name.removesuffix('.zstd')
        with path.open('rb') as packed, plain.open('wb') as file:
            try:
                zstandard.ZstdDecompressor().copy_stream(packed, file)
            except zstandard.ZstdError:
                pass  # truncated or damaged: the reader finds out
        yield plain
