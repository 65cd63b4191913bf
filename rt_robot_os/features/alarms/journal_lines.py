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
The bytes of a journal: a line for each record, with its length and its CRC-32.

::

    R1 0000004e 9d4c21f0 {"at_ns":1795370000000000000,"record":{"seq":1, ...}}

The bytes may be cut or damaged anywhere: every whole record is found again, and the damaged
stretches between them are counted. This module does no input or output.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from dataclasses import field
import json
import re
from typing import Any
from typing import Final
from typing import NamedTuple
import zlib

#: The longest valid line.
LINE_BYTES: Final = 65_536
_HEAD: Final = re.compile(rb'R1 ([0-9a-f]{8}) ([0-9a-f]{8}) ')
_HEAD_BYTES: Final = 21
_END: Final = b'\n'
# Bytes whose checksum is tried while the next line is searched for behind damage. When they are
# used up, as by megabytes of false headers, only lines that begin and end where lines do are
# found.
_SEARCH_BYTES: Final = 32 << 20


class StoredRecord(NamedTuple):
    """
    A record as it is stored.

    :ivar seq: its number.
    :ivar alarm: the alarm that it is about.
    :ivar at_ns: the time of day at which it was stored, in ns since 1970.
    :ivar record: the journal record, with keys of other releases.
    """

    seq: int
    alarm: str
    at_ns: int
    record: dict[str, Any]

    @property
    def is_needed(self) -> bool:
        """Return whether a restart needs it."""
        return self.record.get('state') is not None or bool(self.record.get('lasting'))


class JournalHeader(NamedTuple):
    """
    The first line of a file.

    :ivar generation: how often the journal was rewritten.
    :ivar carried: records of the file before it that follow.
    """

    generation: int
    carried: int


@dataclass
class JournalContents:
    """
    What was found in a file.

    :ivar beginning: its header; None when it is damaged or missing.
    :ivar records: in the order of the file.
    :ivar end: where the last whole line ends.
    :ivar torn_bytes: bytes behind that end, which were cut off.
    :ivar damaged: stretches of bytes before that end that are not lines.
    :ivar ended: the last line has its end, so that another may follow.
    """

    beginning: JournalHeader | None = None
    records: list[StoredRecord] = field(default_factory=list)
    end: int = 0
    torn_bytes: int = 0
    damaged: int = 0
    ended: bool = True

    @property
    def whole(self) -> bool:
        """Return whether the older file is not needed: all carried records are there."""
        return (self.beginning is not None and not self.damaged
                and len(self.records) >= self.beginning.carried)


def encode(payload: str) -> bytes:
    """
    Write a line.

    :raises ValueError: it is too long.
    """
    data = payload.encode()
    if len(data) > LINE_BYTES:
        raise ValueError(f'a record of {len(data)} bytes: at most {LINE_BYTES}')
    return b'R1 %08x %08x %b\n' % (len(data), zlib.crc32(data), data)


def encode_record(text: str, at_ns: int) -> bytes:
    """Write the line of a record, which is JSON already."""
    return encode(f'{{"at_ns":{at_ns},"record":{text}}}')


def encode_header(beginning: JournalHeader) -> bytes:
    """Write the first line of a file."""
    return encode(json.dumps({'journal': 1, **beginning._asdict()}))


def decode(data: bytes) -> JournalContents:
    """Find every whole line; never raises."""
    found = JournalContents()
    position, search_bytes = 0, _SEARCH_BYTES
    while position < len(data):
        if data.startswith(_END, position):
            position = found.end = position + 1  # written over what a crash had left there
            continue
        head = _HEAD.match(data, position)
        end = 0 if head is None else _line_end(data, head)
        if head is not None and end and _take(found, data[head.end():end]):
            found.ended = data[end:end + 1] == _END
            position = end + found.ended
            found.end = position
            continue
        following, search_bytes = _next_line(data, position + 1, search_bytes)
        if following < 0:
            break
        found.damaged += 1
        position = following
    found.torn_bytes = len(data) - found.end
    return found


def _line_end(data: bytes, head: re.Match[bytes]) -> int:
    """Return where the text of a line ends; 0 when it is not whole."""
    length = int(head[1], 16)
    end = head.end() + length
    if length > LINE_BYTES or end > len(data):
        return 0
    return end if zlib.crc32(data[head.end():end]) == int(head[2], 16) else 0


def _next_line(data: bytes, position: int, search_bytes: int) -> tuple[int, int]:
    """
    Search for the next whole line.

    :param search_bytes: how many bytes may be tried before only lines between line ends count.
    :return: where it begins, -1 when there is none, and how many bytes may still be tried.
    """
    for head in _HEAD.finditer(data, position):
        if search_bytes <= 0 and not _between_ends(data, head):
            continue
        search_bytes -= min(int(head[1], 16), LINE_BYTES)
        end = _line_end(data, head)
        if end and _take(JournalContents(), data[head.end():end]):
            return head.start(), search_bytes
    return -1, search_bytes


def _between_ends(data: bytes, head: re.Match[bytes]) -> bool:
    """Return whether a line would begin behind the end of a line and reach to the next end."""
    start, end = head.start(), head.end() + int(head[1], 16)
    return (not start or data[start - 1:start] == _END) and (
        data.find(_END, head.end(), min(end, head.end() + LINE_BYTES) + 1) in (end, -1))


def _take(found: JournalContents, text: bytes) -> bool:
    """Add a line to the contents; return whether it is valid."""
    try:
        said = json.loads(text)
        if 'journal' in said:
            found.beginning = JournalHeader(int(said['generation']), int(said['carried']))
            return True
        record = said['record']
        found.records.append(StoredRecord(
            int(record['seq']), str(record['alarm']), int(said['at_ns']), record))
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return False
    return True


def newest(records: Iterable[StoredRecord]) -> dict[str, StoredRecord]:
    """Return the newest record of each alarm."""
    found: dict[str, StoredRecord] = {}
    for each in records:
        if each.alarm not in found or found[each.alarm].seq < each.seq:
            found[each.alarm] = each
    return found


def retained(records: Iterable[StoredRecord], history_bytes: int) -> list[StoredRecord]:
    """
    Return the records that a new file carries.

    They are those that a restart needs, the last one, and the newest of the rest.

    :param history_bytes: about how many bytes of records that no restart needs.
    """
    ordered = sorted({each.seq: each for each in records}.values())
    living = {each.seq for each in newest(ordered).values() if each.is_needed}
    kept: list[StoredRecord] = []
    left = history_bytes
    for each in reversed(ordered):
        lives = each.seq in living or not kept
        left -= 0 if lives else len(json.dumps(each.record, ensure_ascii=False))
        if lives or left > 0:
            kept.append(each)
    return kept[::-1]
