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


"""The kinds of records, and the shape that each has."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

# In the order of their numbers, which is fixed: rt_robot_os.kernel.black_box.
KINDS = ('job', 'publish', 'interrupt', 'overrun', 'abort', 'ceiling', 'blocked', 'miss', 'mark')
# After the number: t task, o task or -1, n -1, i whole number, s text.
_SHAPES = ('tiiii', 'oisi', 'tis', 'tii', 'tii', 'tiis', 'tii', 'tii', 'nis')
_INT_LIMIT = 1 << 63


def is_record(value: Sequence[Any], tasks: int) -> bool:
    """
    Return whether a sequence is a record.

    Kinds that are not known pass: a later release may have more.

    :param tasks: how many there are.
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
    """Name a kind; ``known`` are the names that came with the record."""
    return known[number] if 0 <= number < len(known) else f'kind {number}'
