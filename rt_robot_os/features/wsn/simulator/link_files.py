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


"""Files of links between nodes: lists of links, and TOSSIM's gains."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Sequence
import gzip
import math
from pathlib import Path
import re
from typing import Final
from typing import NamedTuple
import zlib

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import NS_PER_US

_LONGEST_BYTES: Final = 1 << 29
_MOST_PROBLEMS: Final = 20
_HIGHEST_ID: Final = 65533
_UNITS: Final = {'s': NS_PER_S, 'ms': NS_PER_MS, 'us': NS_PER_US}
_BETWEEN: Final = re.compile(r'[\s,;]+')

LINK_WORDS: Final = 'from to prr rssi lqi'


class Link(NamedTuple):
    """
    The quality of the link from one node to another.

    :ivar prr: packet reception rate, 0 to 1.
    :ivar rssi_dbm: signal strength at the receiver.
    :ivar lqi: link quality indication at the receiver.
    """

    prr: float
    rssi_dbm: float
    lqi: int


class LinkChange(NamedTuple):
    """The quality of a link from a time on."""

    at_ns: int
    source: int
    destination: int
    link: Link


Pair = tuple[int, int]
Links = dict[Pair, Link]
Gains = dict[Pair, float]

_SILENT: Final = Link(0.0, -100.0, 50)


def lines_of(file: str) -> Iterator[tuple[int, str]]:
    """
    Read the lines of a text file, compressed or not, without comments (#).

    :return: number and text of the lines that are not empty.
    :raises ConfigError: it cannot be read.
    """
    path = Path(file)
    try:
        if not path.is_file():
            raise ConfigError([f'{file}: cannot be read: there is no such file'])
        with (gzip.open(path) if path.suffix == '.gz' else path.open('rb')) as stream:
            data = stream.read(_LONGEST_BYTES + 1)
    except (OSError, EOFError, zlib.error) as error:
        reason = getattr(error, 'strerror', None) or str(error)
        raise ConfigError([f'{file}: cannot be read: {reason}']) from None
    if len(data) > _LONGEST_BYTES:
        raise ConfigError([f'{file}: more than {_LONGEST_BYTES} bytes'])
    for number, raw in enumerate(data.decode('utf-8-sig', 'replace').splitlines(), 1):
        text = raw.partition('#')[0].strip()
        if text:
            yield number, text


class _Problems:
    """Collects the errors of a file, with line numbers."""

    def __init__(self, file: str) -> None:
        self._file = file
        self._found: list[str] = []
        self._more = 0

    def add(self, number: int, text: str, remedy: object) -> None:
        if len(self._found) < _MOST_PROBLEMS:
            self._found.append(f'{self._file}:{number}: {text[:80]!r}: {remedy}')
        else:
            self._more += 1

    def raise_any(self) -> None:
        if self._more:
            self._found.append(f'and {self._more} more problems')
        if self._found:
            raise ConfigError(self._found)


def read_links(file: str, time_unit: str = 's') -> tuple[Links, Sequence[LinkChange]]:
    """
    Read a list of links: ``from to prr rssi lqi``, and ``@ t from to prr rssi lqi`` for a change.

    :param time_unit: of t: s, ms or us.
    :return: the links at the start, and the changes in order of time.
    :raises ConfigError: with every invalid line.
    """
    links: Links = {}
    changes: list[LinkChange] = []
    problems = _Problems(file)
    for number, text in lines_of(file):
        changed = text.startswith('@')
        words = _BETWEEN.split(text.lstrip('@').strip())
        try:
            if changed:
                at_ns = round(_number(words[0], 0.0, 1e12, 't') * _UNITS[time_unit])
                changes.append(LinkChange(at_ns, *_link(words[1:], '@ t ')))
            else:
                source, destination, link = _link(words, '')
                links[source, destination] = link
        except ValueError as error:
            problems.add(number, text, error)
    problems.raise_any()
    if not links and not changes:
        raise ConfigError([f'{file}: contains no link: write one a line, as {LINK_WORDS}'])
    changes.sort(key=lambda change: change.at_ns)  # same time: in the order of the file
    return links, changes


def _link(words: Sequence[str], before: str) -> tuple[int, int, Link]:
    silent = len(words) == 3 and _number(words[2], 0.0, 1.0, 'prr') == 0.0
    if len(words) != 5 and not silent:
        raise ValueError(f'must be {before}{LINK_WORDS}')
    source, destination = _id(words[0]), _id(words[1])
    if source == destination:
        raise ValueError(f'node {source} cannot have a link to itself')
    if silent:
        return source, destination, _SILENT
    return source, destination, Link(
        _number(words[2], 0.0, 1.0, 'prr'), _number(words[3], -200.0, 50.0, 'rssi, in dBm,'),
        round(_number(words[4], 0.0, 255.0, 'lqi')))


def read_gains(file: str) -> Gains:
    """
    Read a topology of TOSSIM: ``gain from to dB``; the last line of a pair is used.

    Lines ``noise node floor range``, which TOSSIM's LinkLayerModel writes, are ignored: the noise
    model replaces them. The first word may be missing.

    :raises ConfigError: with every invalid line.
    """
    gains: Gains = {}
    problems = _Problems(file)
    for number, text in lines_of(file):
        words = _BETWEEN.split(text)
        if words[0] == 'noise':
            continue
        if words[0] == 'gain':
            del words[0]
        try:
            if len(words) != 3:
                raise ValueError('must be gain from to dB')
            source, destination = _id(words[0]), _id(words[1])
            if source != destination:  # the gain from a node to itself has no meaning
                gains[source, destination] = _number(words[2], -1000.0, 200.0, 'gain, in dB,')
        except ValueError as error:
            problems.add(number, text, error)
    problems.raise_any()
    if not gains:
        raise ConfigError([f'{file}: contains no gain: write one a line, as gain from to dB'])
    return gains


def _id(word: str) -> int:
    if not (word.isascii() and word.isdigit() and len(word) < 9 and int(word) <= _HIGHEST_ID):
        raise ValueError(f'{word!r} must be a node, from 0 to {_HIGHEST_ID}')
    return int(word)


def _number(word: str, least: float, most: float, what: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not least <= value <= most:
        raise ValueError(f'{what} must be a number from {least:g} to {most:g}, not {word!r}')
    return value
