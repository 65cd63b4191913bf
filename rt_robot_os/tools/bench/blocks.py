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

"""The parts of a report, whatever it is written as: a page, Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rt_robot_os.tools.bench.plot import Plot


@dataclass(frozen=True)
class Heading:
    """A title; level 1 is that of the report."""

    text: str
    level: int


@dataclass(frozen=True)
class Paragraph:
    """Running text."""

    text: str


@dataclass(frozen=True)
class Bullets:
    """A list."""

    items: Sequence[str]


@dataclass(frozen=True)
class CodeBlock:
    """What is typed, and in which language."""

    text: str
    language: str = 'bash'


@dataclass(frozen=True)
class TableBlock:
    """
    A table.

    :ivar rows: cells as text, the label first; shorter rows have their last cell widened.
    :ivar kinds: of each row: ``ours``, ``published``, ``absent``, ``reached``, ``missed``, empty.
    :ivar words: columns, from the left, that hold words and not numbers.
    :ivar groups: (name, unit) over each heading; equal neighbours share it; or empty.
    """

    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    kinds: Sequence[str]
    words: int = 1
    groups: Sequence[tuple[str, str]] = ()


@dataclass(frozen=True)
class PictureBlock:
    """A plot; ``unique`` names it within the report and as a file."""

    plot: Plot
    unique: str


Block = Heading | Paragraph | Bullets | CodeBlock | TableBlock | PictureBlock
