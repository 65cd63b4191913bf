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

"""Counters of the packets of a network, and of those that could not be used."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
import re
from typing import Final

#: Largest number of problems that the statistics list.
NAMED: Final = 8
# Largest number of kinds with a counter of their own; the total includes the others.
_KEPT: Final = 4 * NAMED
_DIGITS: Final = re.compile(r'\d+')


@dataclass
class ModelCounters:
    """Packets received, and those that could not be used."""

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
    """Counters of AM types."""

    __slots__ = ('counts',)

    def __init__(self) -> None:
        self.counts: Counter[int] = Counter()

    def add(self, number: int) -> None:
        """Count a number; numbers beyond the limit are ignored."""
        if number in self.counts or len(self.counts) < _KEPT:
            self.counts[number] += 1

    def text(self) -> str:
        """Return all counters, such as ``0x05:3 0x93:1``."""
        return ' '.join(f'{each:#04x}:{count}' for each, count in sorted(
            self.counts.copy().items()))


class ProblemCounts:
    """Counters of problems: texts that differ only in numbers are of one kind."""

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
        """Return the most frequent kinds, each with its last text."""
        return {self._examples[kind]: count
                for kind, count in self._counts.copy().most_common(NAMED)}
