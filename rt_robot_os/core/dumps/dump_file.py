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
The file of a dump: the parts of :mod:`.dump_parts` as JSON lines, compressed.

``zcat`` shows it. A file is written under another name and then renamed, so that it is always
complete.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Iterator
from dataclasses import dataclass
import errno
import gzip
import json
import os
from pathlib import Path
import zlib

from rt_robot_os.base.errors import BlackBoxError
from rt_robot_os.core.dumps.dump_parts import DamagedError
from rt_robot_os.core.dumps.dump_parts import Joiner
from rt_robot_os.core.dumps.dump_parts import Part
from rt_robot_os.kernel.black_box import BlackBoxDump

SUFFIX = '.rtbb.gz'
LINE_BYTES_MAXIMUM = 1 << 20
FILE_BYTES_MAXIMUM = 1 << 28


@dataclass(frozen=True)
class DumpFile:
    """
    The content of a file.

    :ivar facts: of its origin: robot, host, time of day.
    :ivar kinds: the names of the kinds of records that the writer knew, by number.
    """

    dump: BlackBoxDump
    facts: dict[str, str | int]
    kinds: tuple[str, ...]


def write_parts(source: Iterable[Part], path: Path) -> int:
    """
    Write the parts of a dump; not for the real-time loop.

    :return: the length of the file in bytes.
    :raises BlackBoxError: it cannot be written; nothing is left behind.
    """
    partial = path.with_name(f'.{path.name}.{os.getpid()}')
    try:
        try:
            with partial.open('xb') as raw:
                with gzip.GzipFile('', 'wb', 6, raw, mtime=0) as packed:
                    for part in source:
                        packed.write(json.dumps(part, separators=(',', ':')).encode() + b'\n')
                raw.flush()
                os.fsync(raw.fileno())
                size = raw.tell()
            partial.rename(path)
            return size
        finally:
            partial.unlink(missing_ok=True)
    except OSError as error:
        raise BlackBoxError(f'{path} cannot be written: {error.strerror or error}; '
                            f'{_remedy(error)}') from error


def _remedy(error: OSError) -> str:
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return 'free space on the disk, or choose a folder on another one (core.black_box_folder)'
    if error.errno == errno.ENOENT:
        return 'create the folder, or choose another one'
    return 'choose a writable folder (core.black_box_folder)'


def read_dump(path: Path) -> DumpFile:
    """
    Read a dump.

    :raises BlackBoxError: it does not exist, is damaged, or has another version.
    """
    joiner = Joiner()
    number = 0
    try:
        for number, line in enumerate(_lines(path), 1):
            joiner.add(json.loads(line))
        return DumpFile(joiner.dump(), joiner.facts, joiner.kinds)
    except DamagedError as error:
        where = f'{path}, line {number}' if number and not joiner.complete else f'{path}'
        raise BlackBoxError(f'{where}: {error}') from error
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise BlackBoxError(
            f'{path} is not a complete dump of a black box ({error}): it was truncated or changed '
            'after it was written; copy it again, or request a new one with `black_box dump`'
        ) from error
    except OSError as error:
        raise BlackBoxError(f'{path} cannot be read: {error.strerror or error}; '
                            'to list the dumps: `black_box list`') from error
    except (ValueError, RecursionError) as error:
        raise BlackBoxError(f'{path}, line {number + 1}: not JSON ({error}); is it a dump of a '
                            'black box?') from error


def _lines(path: Path) -> Iterator[bytes]:
    total = 0
    with gzip.open(path) as stream:
        read: Callable[[int], bytes] = stream.readline
        while line := read(LINE_BYTES_MAXIMUM):
            total += len(line)
            if total > FILE_BYTES_MAXIMUM or not line.endswith(b'\n'):
                raise DamagedError(
                    f'is not a dump of a black box: more than {FILE_BYTES_MAXIMUM} bytes, or a '
                    f'line of more than {LINE_BYTES_MAXIMUM}')
            yield line
