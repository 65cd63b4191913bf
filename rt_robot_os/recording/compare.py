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

"""Compare the publications of a replay with the recorded ones, byte by byte."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
import struct
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.recording.reading import Recorded
from rt_robot_os.topics import Layout

_STAMP: Final = struct.Struct('<iI')
_NO_STAMP: Final = bytes(_STAMP.size)
_LINES_MOST: Final = 12


@dataclass(frozen=True)
class Produced:
    """
    A publication of the replay.

    :ivar number: of the publication that the real run made at this time; None if it made none.
    :ivar stamp_ns: of the data; at_ns: when it was published; both on CLOCK_MONOTONIC.
    """

    topic: str
    number: int | None
    stamp_ns: int
    at_ns: int
    cdr: bytes


@dataclass(frozen=True)
class Difference:
    """
    One publication that differs.

    :ivar at_ns: when it was published, on CLOCK_MONOTONIC.
    :ivar lines: the differences, one line per field.
    """

    topic: str
    number: int | None
    at_ns: int
    lines: tuple[str, ...]


@dataclass
class Count:
    """
    The result of the comparison of a topic.

    :ivar settling: samples that differ before the first identical one; only in a recording that
        started in the middle of a run.
    :ivar unrecorded: samples that the recorder did not receive, so that they cannot be compared.
    :ivar compared: recorded samples that have a counterpart.
    """

    same: int = 0
    different: int = 0
    missing: int = 0
    extra: int = 0
    settling: int = 0
    unrecorded: int = 0
    compared: int = 0

    @property
    def never_same(self) -> bool:
        """Whether it was recorded and compared, but never identical."""
        return bool(self.settling and self.compared and not self.same)


def without_stamp(cdr: bytes, offset: int | None) -> bytes:
    """Return a message with zeros in ``header.stamp``, as in the slots of the core."""
    if offset is None or len(cdr) < offset + _STAMP.size:
        return cdr
    return cdr[:offset] + _NO_STAMP + cdr[offset + _STAMP.size:]


def with_stamp(cdr: bytes, offset: int | None, wall_ns: int) -> bytes:
    """Return a message with a time of day in ``header.stamp``, as the recorder writes it."""
    if offset is None:
        return cdr
    return (cdr[:offset] + _STAMP.pack(*divmod(wall_ns, NS_PER_S))
            + cdr[offset + _STAMP.size:])


class Comparison:
    """
    Compare publications by topic and number.

    :param layouts: of the replayed core, by topic.
    :param cold: the replay starts in the state of the real run; otherwise that is unknown.
    :ivar first: the first difference in time.
    """

    def __init__(self, layouts: Mapping[str, Layout], cold: bool) -> None:
        self.counts: dict[str, Count] = {}
        self.first: Difference | None = None
        self._layouts = layouts
        self._cold = cold
        self._recorded: dict[tuple[str, int], Recorded] = {}
        self._produced: dict[tuple[str, int], Produced] = {}
        self._scheduled: dict[tuple[str, int], int] = {}
        self._met: set[str] = set()

    @property
    def identical(self) -> bool:
        """Whether nothing differs; a topic that was never identical counts as different."""
        return not any(c.different or c.missing or c.extra or c.never_same
                       for c in self.counts.values())

    def recorded(self, sample: Recorded) -> None:
        """Add a sample of the recording."""
        self._recorded[sample.topic, sample.number] = sample

    def scheduled(self, topic: str, number: int, at_ns: int) -> None:
        """Add a publication that the replay must make."""
        self._scheduled[topic, number] = at_ns

    def produced(self, one: Produced) -> None:
        """Add a publication of the replay."""
        count = self.counts.setdefault(one.topic, Count())
        if one.number is None:
            self._differs(count, 'extra', Difference(
                one.topic, None, one.at_ns, ('the real run published nothing then',)))
            return
        key = (one.topic, one.number)
        self._scheduled.pop(key, None)
        self._produced[key] = one

    def settle(self, until_ns: int) -> None:
        """Compare everything up to a time, and remove it."""
        for key, at_ns in sorted(self._scheduled.items(), key=lambda item: item[1]):
            if at_ns < until_ns:
                del self._scheduled[key]
                self._recorded.pop(key, None)
                self._differs(self.counts.setdefault(key[0], Count()), 'missing', Difference(
                    *key, at_ns, ('the replay published nothing then',)))
        for key, one in list(self._produced.items()):
            sample = self._recorded.pop(key, None)
            if sample is not None:
                del self._produced[key]
                self._compare(one, sample)
            elif one.at_ns < until_ns:
                del self._produced[key]
                self.counts[one.topic].unrecorded += 1

    def _compare(self, one: Produced, sample: Recorded) -> None:
        count, layout = self.counts[one.topic], self._layouts[one.topic]
        count.compared += 1
        offset = layout.stamp_offset
        before, after = without_stamp(sample.cdr, offset), without_stamp(one.cdr, offset)
        wall_ns = one.stamp_ns + sample.offset_ns
        # The recorder makes stamps strictly increasing: it used the next possible one.
        stamps_agree = sample.log_ns == wall_ns or (
            sample.log_ns == sample.before_ns + 1 and wall_ns <= sample.before_ns)
        if before == after and stamps_agree:
            count.same += 1
            self._met.add(one.topic)
            return
        lines = [] if stamps_agree else [
            f'stamp: recorded {_time(sample.log_ns)}, replayed {_time(wall_ns)} '
            f'({(wall_ns - sample.log_ns) / 1000:+.3f} us)']
        if before != after:
            lines += field_differences(layout, before, after)
        self._differs(count, 'different',
                      Difference(one.topic, one.number, one.at_ns, tuple(lines)))

    def _differs(self, count: Count, kind: str, difference: Difference) -> None:
        if not self._cold and difference.topic not in self._met:
            count.settling += 1
            return
        setattr(count, kind, getattr(count, kind) + 1)
        if self.first is None or difference.at_ns < self.first.at_ns:
            self.first = difference


def _time(wall_ns: int) -> str:
    return f'{wall_ns // NS_PER_S}.{wall_ns % NS_PER_S:09d}'


def field_differences(layout: Layout, before: bytes, after: bytes) -> list[str]:
    """Return the fields in which two messages differ."""
    for name, cdr in (('recorded', before), ('replayed', after)):
        problem = layout.check(cdr)
        if problem:
            return [f'the {name} message is not a {layout.type_name} of this configuration: '
                    f'{problem}']
    lines: list[str] = []
    _walk('', layout.to_dict(before), layout.to_dict(after), lines)
    if len(lines) > _LINES_MOST:
        lines[_LINES_MOST:] = [f'and {len(lines) - _LINES_MOST} more']
    return lines or ['the bytes differ outside of fields']


def _walk(path: str, before: Any, after: Any, lines: list[str]) -> None:
    if isinstance(before, dict) and isinstance(after, dict):
        for key in before:
            _walk(f'{path}.{key}' if path else key, before[key], after.get(key), lines)
    elif isinstance(before, list) and isinstance(after, list) and len(before) == len(after):
        for number, (one, other) in enumerate(zip(before, after)):
            _walk(f'{path}[{number}]', one, other, lines)
    elif before != after and not (before != before and after != after):
        lines.append(f'{path}: recorded {before!r}, replayed {after!r}')
