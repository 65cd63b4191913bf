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

"""What came of a network and what could not be used: counted, and named while there is room."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
import re
from typing import Final

#: Problems that are named in the statistics, at most.
NAMED: Final = 8
# Kinds that are counted each by itself; the rest is in the number of all.
_KEPT: Final = 4 * NAMED
_DIGITS: Final = re.compile(r'\d+')


@dataclass
class ModelCounters:
    """What came, and what could not be used."""

    packets: int = 0
    data: int = 0
    beacons: int = 0
    debug: int = 0
    commands: int = 0
    unknown: int = 0
    problems: int = 0
    foreign_groups: int = 0
    without_origin: int = 0
    nodes_refused: int = 0
    nodes_forgotten: int = 0
    loops_told: int = 0


class TypeCounts:
    """How often each of some numbers came."""

    __slots__ = ('counts',)

    def __init__(self) -> None:
        self.counts: Counter[int] = Counter()

    def add(self, number: int) -> None:
        """Count a number; those that have no room are left out."""
        if number in self.counts or len(self.counts) < _KEPT:
            self.counts[number] += 1

    def text(self) -> str:
        """Return all, such as ``0x05:3 0x93:1``."""
        return ' '.join(f'{each:#04x}:{count}' for each, count in sorted(
            self.counts.copy().items()))


class ProblemCounts:
    """How often each kind of problem came: those that differ in numbers alone are of one kind."""

    __slots__ = ('_counts', '_examples')

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter()
        self._examples: dict[str, str] = {}

    def add(self, text: str) -> None:
        """Count a problem."""
        kind = _DIGITS.sub('#', text)
        if kind in self._counts or len(self._counts) < _KEPT:
            self._counts[kind] += 1
            self._examples[kind] = text

    def named(self) -> Mapping[str, int]:
        """Return the most frequent kinds, each in its last form."""
        return {self._examples[kind]: count
                for kind, count in self._counts.copy().most_common(NAMED)}
