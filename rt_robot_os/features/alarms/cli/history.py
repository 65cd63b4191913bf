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

"""The content of a journal, for people and as JSON; it may be written meanwhile."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.alarms.cli.table import event_line
from rt_robot_os.features.alarms.journal_device.folder import JournalFolder
from rt_robot_os.features.alarms.journal_file import JournalHistory
from rt_robot_os.features.alarms.journal_file import NAME
from rt_robot_os.features.alarms.journal_file import OLDER
from rt_robot_os.features.alarms.journal_file import read_journal
from rt_robot_os.features.alarms.journal_lines import decode
from rt_robot_os.features.alarms.journal_lines import StoredRecord
from rt_robot_os.linux.folders import read_file
from rt_robot_os.linux.folders import ros_home
from rt_robot_os.messages.alarm_event import AlarmEvent
from rt_robot_os.messages.journal import JournalRecord

#: The folder of a device of type journal, unless it says another.
DEFAULT_FOLDER = 'alarms'
_LARGEST_BYTES = 256 << 20


def find(name: str) -> JournalHistory:
    """
    Read a journal.

    :param name: its folder, or one of its files; empty: the one in this user's folder of ROS.
    :raises ConfigError: there is none.
    """
    path = Path(name).expanduser() if name else ros_home() / DEFAULT_FOLDER
    try:
        if path.is_dir():
            if not any((path / each).exists() for each in (NAME, OLDER)):
                raise ConfigError([f'{path} has no journal of alarms ({NAME})'])
            return read_journal(JournalFolder(path))
        contents = decode(read_file(path, _LARGEST_BYTES))
    except OSError as error:
        raise ConfigError([f'{path}: {error.strerror}: name the folder of a device of type '
                           'journal']) from error
    return JournalHistory(contents.records, contents.torn_bytes, contents.damaged,
                          contents.beginning.generation if contents.beginning else 0)


def as_dict(found: JournalHistory) -> dict[str, Any]:
    """Return all of it for JSON."""
    return {'generation': found.generation, 'torn_bytes': found.torn_bytes,
            'damaged': found.damaged,
            'open': [each.record['state'] for each in found.living() if each.record.get('state')],
            'records': [{'at_ns': each.at_ns, **each.record} for each in found.records]}


def lines(found: JournalHistory) -> list[str]:
    """Return an event a line, then what is open and what was damaged."""
    told = []
    for each in found.records:
        day = datetime.fromtimestamp(each.at_ns / NS_PER_S).strftime('%Y-%m-%d')
        for event, written_ns in _events(each):
            told.append(f'{day} {event_line(event, each.at_ns - written_ns)}')
    count = sum(bool(each.record.get('state')) for each in found.living())
    told.append(f'{len(found.records)} records, {count} alarms open')
    if found.torn_bytes or found.damaged:
        told.append(f'{found.torn_bytes} bytes cut off at the end, {found.damaged} damaged '
                    'places: all whole records are above')
    return told


def _events(stored: StoredRecord) -> Iterator[tuple[AlarmEvent, int]]:
    """Yield the events of a record, each with the time of the record on the core's clock."""
    try:
        record = JournalRecord.from_dict(stored.record)
    except ValueError:
        return
    for each in record.events:
        try:
            yield AlarmEvent.from_dict(each), record.t_ns
        except ValueError:
            continue
