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
Divide a dump into small parts and join them, for the file, the link and the writer process.

A dump is a sequence of parts, each a small dictionary of plain values: first ``head``, then
``tasks``, ``running`` and ``records`` in lists of bounded length, last ``end`` with the number of
records. The parts are encoded one at a time, so that no native call delays a real-time task for
long. A sequence without its ``end``, or with another number of records, is incomplete.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import replace
from itertools import islice
from typing import Any

from rt_robot_os.base.errors import BlackBoxError
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel.black_box import BlackBox
from rt_robot_os.kernel.black_box import BlackBoxDump
from rt_robot_os.kernel.black_box import dump
from rt_robot_os.kernel.black_box import TaskFacts

# In the order of their numbers, which is fixed: rt_robot_os.kernel.black_box.
KINDS = ('job', 'publish', 'interrupt', 'overrun', 'abort', 'ceiling', 'blocked', 'miss', 'mark')
# After the number: t task, o task or -1, n -1, i integer, s string.
_SHAPES = ('tiiii', 'oisi', 'tis', 'tii', 'tii', 'tiis', 'tii', 'tii', 'nis')
_INT_LIMIT = 1 << 63


def is_record(value: Sequence[Any], tasks: int) -> bool:
    """
    Return whether a sequence is a record.

    Unknown kinds are accepted: a later release may have more.

    :param tasks: the number of tasks.
    """
    if not value or not _is_int(value[0]) or value[0] < 0:
        return False
    if value[0] >= len(_SHAPES):
        return all(isinstance(item, str) or item is None or _is_int(item) for item in value)
    shape = _SHAPES[value[0]]
    return len(value) == len(shape) + 1 and all(
        _fits(item, letter, tasks) for letter, item in zip(shape, value[1:]))


def _is_int(value: object) -> bool:
    return (isinstance(value, int) and not isinstance(value, bool)
            and -_INT_LIMIT <= value < _INT_LIMIT)


def _fits(item: object, letter: str, tasks: int) -> bool:
    if letter == 's':
        return isinstance(item, str)
    if not isinstance(item, int) or not _is_int(item):
        return False
    if letter == 't':
        return 0 <= item < tasks
    if letter == 'o':
        return -1 <= item < tasks
    return item == -1 if letter == 'n' else True


def kind_name(number: int, known: Sequence[str] = KINDS) -> str:
    """Return the name of a kind; ``known`` are the names that came with the record."""
    return known[number] if 0 <= number < len(known) else f'kind {number}'


FORMAT = 'rt_robot_os black box'
VERSION = 1
# A JSON line of this many records is about 1 KiB, and takes about 30 us to encode.
RECORDS_PER_PART = 16
_INT_LIMIT = 1 << 63
_TASKS_MAXIMUM = 10_000

Part = dict[str, Any]


def parts(whole: BlackBoxDump, facts: Mapping[str, str | int] | None = None) -> Iterator[Part]:
    """
    Divide a dump into parts.

    :param facts: further facts for the reader, such as the robot's name.
    """
    yield from _parts(whole, whole.records, len(whole.records), facts)


def live_parts(kernel: Kernel, reason: str, facts: Mapping[str, str | int] | None = None
               ) -> Iterator[Part]:
    """
    Divide the black box of a running kernel into parts; only at its lowest priorities.

    The black box is copied by one native call, about 5 us per thousand records; the rest can be
    preempted. No complete :class:`BlackBoxDump` is made: 8192 tuples are one native call of
    500 us, so they are created, and freed, one by one.
    """
    records = kernel.black_box.copy()
    head = dump(BlackBox(1), kernel.tasks, reason, kernel.now_ns(), kernel.start_ns)
    head = replace(head, full=len(records) == records.capacity)
    numbers: dict[Any, int] = {task: number for number, task in enumerate(kernel.tasks)}

    def numbered() -> Iterator[tuple[Any, ...]]:
        while (record := records.pop_oldest()) is not None:
            yield (record[0], numbers.get(record[1], -1), *record[2:])

    return _parts(head, numbered(), len(records), facts)


def _parts(head: BlackBoxDump, records: Iterable[tuple[Any, ...]], count: int,
           facts: Mapping[str, str | int] | None) -> Iterator[Part]:
    yield {'format': FORMAT, 'version': VERSION, 'reason': head.reason, 'at_ns': head.at_ns,
           'start_ns': head.start_ns, 'full': head.full, 'kinds': list(KINDS),
           'facts': dict(facts or {})}
    step = RECORDS_PER_PART
    for at in range(0, len(head.tasks), step):
        yield {'tasks': [[t.name, t.priority, t.period_ns] for t in head.tasks[at:at + step]]}
    yield {'running': head.running}
    rest = iter(records)
    while some := tuple(islice(rest, step)):
        yield {'records': some}
    yield {'end': count}


class DamagedError(BlackBoxError):
    """A part is not valid; the message gives the problem."""


class Joiner:
    """
    Join the parts of a dump, which are not trusted.

    :ivar facts: the further facts that came with it.
    :ivar kinds: the names of the kinds of records that the sender knew, by number.
    :ivar complete: the last part has been added.
    """

    def __init__(self) -> None:
        self.facts: dict[str, str | int] = {}
        self.kinds: tuple[str, ...] = ()
        self.complete = False
        self._head: Part = {}
        self._tasks: list[TaskFacts] = []
        self._running: tuple[tuple[int, int, int], ...] = ()
        self._records: list[tuple[Any, ...]] = []

    def add(self, part: object) -> None:
        """
        Add the next part.

        :raises DamagedError: it is not a part, or not the next.
        """
        if not isinstance(part, dict):
            raise DamagedError('is not an object')
        if not self._head:
            self._add_head(part)
        elif self.complete:
            raise DamagedError('follows the end')
        elif 'tasks' in part:
            self._tasks += [_task(each) for each in _listed(part['tasks'])]
            if len(self._tasks) > _TASKS_MAXIMUM:
                raise DamagedError(f'holds more than {_TASKS_MAXIMUM} tasks')
        elif 'running' in part:
            self._running = tuple(self._job(each) for each in _listed(part['running']))
        elif 'records' in part:
            self._records += [self._record(each) for each in _listed(part['records'])]
        elif 'end' in part:
            if part['end'] != len(self._records):
                raise DamagedError(f'should hold {part["end"]!r} records, but holds '
                                   f'{len(self._records)}')
            self.complete = True

    def _add_head(self, part: Part) -> None:
        if part.get('format') != FORMAT:
            raise DamagedError(f'is not the beginning of a black box (format '
                               f'{part.get("format")!r})')
        if part.get('version') != VERSION:
            raise DamagedError(f'has version {part.get("version")!r} of the format, but this '
                               f'release of rt_robot_os reads version {VERSION}; use the release '
                               'that wrote it')
        if not isinstance(part.get('reason'), str):
            raise DamagedError('has no reason')
        for key in ('at_ns', 'start_ns'):
            if not _is_int(part.get(key)):
                raise DamagedError(f'has {key} {part.get(key)!r}, which is not an integer')
        if not isinstance(part.get('full'), bool):
            raise DamagedError('does not say whether the black box was full')
        facts = part.get('facts')
        if isinstance(facts, dict):
            self.facts = {str(key): value for key, value in facts.items()
                          if isinstance(value, str) or _is_int(value)}
        kinds = part.get('kinds')
        if isinstance(kinds, list):
            self.kinds = tuple(str(kind) for kind in kinds)
        self._head = part

    def _job(self, value: object) -> tuple[int, int, int]:
        if (not isinstance(value, list | tuple) or len(value) != 3
                or not all(_is_int(item) for item in value)
                or not 0 <= value[0] < len(self._tasks)):
            raise DamagedError(f'holds {_short(value)} where a running job is expected')
        return value[0], value[1], value[2]

    def _record(self, value: object) -> tuple[Any, ...]:
        if not isinstance(value, list | tuple) or not is_record(value, len(self._tasks)):
            raise DamagedError(f'holds {_short(value)} where a record is expected')
        return tuple(value)

    def dump(self) -> BlackBoxDump:
        """
        Return the dump.

        :raises DamagedError: the end is missing.
        """
        if not self._head:
            raise DamagedError('is empty')
        if not self.complete:
            raise DamagedError(f'ends after {len(self._records)} records, without its end')
        head = self._head
        return BlackBoxDump(
            reason=head['reason'], at_ns=head['at_ns'], start_ns=head['start_ns'],
            tasks=tuple(self._tasks), running=self._running, records=tuple(self._records),
            full=head['full'])


def join(received: Iterable[object]) -> BlackBoxDump:
    """
    Join all parts of a dump.

    :raises DamagedError: a part is not valid.
    """
    joiner = Joiner()
    for part in received:
        joiner.add(part)
    return joiner.dump()


def _listed(value: object) -> list[Any] | tuple[Any, ...]:
    if not isinstance(value, list | tuple):
        raise DamagedError(f'holds {_short(value)} where a list is expected')
    return value


def _task(value: object) -> TaskFacts:
    if (not isinstance(value, list | tuple) or len(value) != 3 or not isinstance(value[0], str)
            or not _is_int(value[1]) or not _is_int(value[2])):
        raise DamagedError(f'holds {_short(value)} where a task is expected')
    return TaskFacts(value[0], value[1], value[2])


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 80 else f'{text[:77]}...'
