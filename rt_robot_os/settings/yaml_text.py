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
Parse YAML to a tree with line numbers, with the value rules of ROS 2.

It reads the parser's events: PyYAML's own loaders silently drop repeated keys, lose line numbers,
and recurse without a limit. Their value rules are not used either: ROS 2 has its own
(rcl_yaml_param_parser), by which ``1e9`` is a number, ``010`` is eight, and ``1_000`` and
``2026-01-01`` are strings. The robot and ``ros2 param`` must agree.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from dataclasses import field
import math
import re
from typing import Any
from typing import Final

from rt_robot_os.settings.tree import Leaf
from rt_robot_os.settings.tree import NO_VALUE
from rt_robot_os.settings.tree import Origin
from rt_robot_os.settings.tree import RawMap

Scalar = bool | int | float | str

NULLS: Final = frozenset({'~', 'null', 'Null', 'NULL'})

_TRUE = frozenset('Y y yes Yes YES true True TRUE on On ON'.split())
_FALSE = frozenset('N n no No NO false False FALSE off Off OFF'.split())
_INTEGER = re.compile(r'([+-]?)(?:0[xX]([0-9a-fA-F]+)|(0[0-7]*)|([1-9][0-9]*))', re.ASCII)
_DECIMAL = re.compile(r'[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?', re.ASCII)
_HEXADECIMAL = re.compile(
    r'[+-]?0[xX](?:[0-9a-fA-F]+\.?[0-9a-fA-F]*|\.[0-9a-fA-F]+)(?:[pP][+-]?[0-9]+)?', re.ASCII)
_INFINITY = re.compile(r'[+-]?(?:\.(?:inf|Inf|INF)|(?i:infinity|inf))', re.ASCII)
_NAN = re.compile(r'\.(?:nan|NaN|NAN)|[+-]?(?i:nan)', re.ASCII)

# Longer than any number: int() must not be called with thousands of digits.
_LONGEST_NUMBER = 400
INT64_END: Final = 2 ** 63

DEEPEST = 20

_TAG = 'tag:yaml.org,2002:'
_KNOWN_TAGS = frozenset({f'{_TAG}{name}' for name in ('str', 'map', 'seq')} | {'!'})


class YamlProblem(Exception):
    """The text cannot be parsed; has the place and the reason."""

    def __init__(self, reason: str, line: int = 0, column: int = 0) -> None:
        self.line = line
        place = f'column {column}: ' if column else ''
        super().__init__(f'{place}{reason}')


@dataclass
class _Open:
    """A mapping or a list whose end was not parsed yet."""

    node: RawMap | None
    origin: Origin
    key: tuple[str, Origin] | None = None
    values: list[Any] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)
    fault: str = ''


def parse(text: str, file: str) -> Leaf | RawMap | None:
    """
    Parse one YAML document.

    :param file: name of the text in errors.
    :return: None when the text is empty.
    :raises YamlProblem: at the first place that is not YAML.
    """
    return _Builder(file).build(_events(text))


def _kind(event: Any) -> str:
    return type(event).__name__.removesuffix('Event')


def _events(text: str) -> Iterable[Any]:
    # Late: the core reads its settings as JSON, and all that it imports is locked in memory.
    import yaml

    try:
        yield from yaml.parse(text, Loader=yaml.SafeLoader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        reason = ' '.join(part for part in (error.context, error.problem) if part)
        if '\\t' in reason:
            reason = 'a tab: YAML is indented with spaces only'
        if mark is None:
            raise YamlProblem(f'not YAML: {reason}') from None
        raise YamlProblem(f'not YAML: {reason}', mark.line + 1, mark.column + 1) from None
    except yaml.reader.ReaderError as error:
        before = text[:error.position]
        line, column = before.count('\n') + 1, error.position - (before.rfind('\n') + 1) + 1
        raise YamlProblem(
            f'not YAML: character {error.character!r} is not allowed', line, column) from None
    except (yaml.YAMLError, ValueError, OverflowError) as error:
        # PyYAML does not catch errors of int() and chr() for invalid escapes.
        raise YamlProblem(f'not YAML: {error}') from None


class _Builder:
    """Build a tree from events, with an explicit stack."""

    def __init__(self, file: str) -> None:
        self._file = file
        self._stack: list[_Open] = []
        self._root: Leaf | RawMap | None = None
        self._documents = 0

    def build(self, events: Iterable[Any]) -> Leaf | RawMap | None:
        for event in events:
            line, column = event.start_mark.line + 1, event.start_mark.column + 1
            origin = Origin(self._file, line)
            kind = _kind(event)
            if kind == 'DocumentStart':
                self._documents += 1
                if self._documents > 1:
                    raise YamlProblem("a second document ('---'): write one", line, column)
            elif kind in ('MappingStart', 'SequenceStart'):
                self._start(event, origin, column)
            elif kind in ('MappingEnd', 'SequenceEnd'):
                self._end()
            elif kind == 'Alias':
                reason = f"'*{event.anchor}': ROS 2 has no aliases, repeat the value"
                raise YamlProblem(reason, line, column)
            elif kind == 'Scalar':
                self._scalar(event, origin)
        return self._root

    def _start(self, event: Any, origin: Origin, column: int) -> None:
        if len(self._stack) >= DEEPEST:
            raise YamlProblem(
                f'nested more than {DEEPEST} deep', origin.line, column)
        is_map = _kind(event) == 'MappingStart'
        top = self._stack[-1] if self._stack else None
        if top is not None and top.node is not None and top.key is None:
            raise YamlProblem('a key must be a string', origin.line, column)
        opened = _Open(RawMap(origin) if is_map else None, origin, fault=_tag_fault(event.tag))
        if top is not None and top.node is None:
            top.fault = 'a list must not contain a section or a list: ROS 2 parameters are flat'
        self._stack.append(opened)

    def _end(self) -> None:
        done = self._stack.pop()
        if done.node is not None and not done.fault:
            self._place(done.node, done.origin)
            return
        fault = done.fault or _item_fault(done.values)
        self._place(Leaf(done.origin, tuple(done.values), fault, tuple(done.lines)), done.origin)

    def _scalar(self, event: Any, origin: Origin) -> None:
        top = self._stack[-1] if self._stack else None
        if top is not None and top.node is not None and top.key is None:
            top.key = (event.value, origin)
            return
        quoted = event.style in ('"', "'") or event.tag == f'{_TAG}str'
        value = scalar(event.value, quoted)
        fault = _tag_fault(event.tag)
        if not quoted and (event.value == '' or event.value in NULLS):
            self._place(Leaf(origin, None, NO_VALUE), origin)
        else:
            self._place(Leaf(origin, value, fault), origin)

    def _place(self, node: Leaf | RawMap, origin: Origin) -> None:
        if not self._stack:
            self._root = node
            return
        top = self._stack[-1]
        if top.node is not None:
            if top.key is not None:
                key, key_origin = top.key
                top.key = None
                top.node.items.append((key, key_origin, _moved(node, key_origin)))
        elif isinstance(node, Leaf):
            top.values.append(node.value)
            top.lines.append(origin.line)
            top.fault = top.fault or node.fault


def _moved(node: Leaf | RawMap, origin: Origin) -> Leaf | RawMap:
    """Return the node with the line of its key, where a user looks for it."""
    if isinstance(node, RawMap):
        return RawMap(origin, node.items)
    return Leaf(origin, node.value, node.fault, node.lines)


def _tag_fault(tag: str | None) -> str:
    if tag is None or tag in _KNOWN_TAGS:
        return ''
    return f'the tag {tag!r} is unknown to ROS 2: delete it'


def _item_fault(values: list[Any]) -> str:
    kinds = {type(value) for value in values}
    if len(kinds) < 2:
        return ''
    if kinds == {int, float}:
        return 'ROS 2 requires a list of one type: write integers with a decimal point (1.0)'
    return 'ROS 2 requires a list of one type: quote strings'


def scalar(text: str, quoted: bool) -> Scalar:
    """
    Parse one YAML scalar as ROS 2 does.

    :param text: the scalar without its quotes.
    :param quoted: whether it had quotes; then it is always a string.
    """
    if quoted or len(text) > _LONGEST_NUMBER:
        return text
    if text in _TRUE:
        return True
    if text in _FALSE:
        return False
    whole = _integer(text)
    if whole is not None:
        return whole
    number = _number(text)
    return text if number is None else number


def _integer(text: str) -> int | None:
    match = _INTEGER.fullmatch(text)
    if match is None:
        return None
    sign, hexadecimal, octal, decimal = match.groups()
    if hexadecimal:
        value = int(hexadecimal, 16)
    else:
        value = int(octal, 8) if octal else int(decimal)
    value = -value if sign == '-' else value
    return value if -INT64_END <= value < INT64_END else None


def _number(text: str) -> float | None:
    if _INFINITY.fullmatch(text):
        return -math.inf if text.startswith('-') else math.inf
    if _NAN.fullmatch(text):
        return math.nan
    if _DECIMAL.fullmatch(text):
        value = float(text)
    elif _HEXADECIMAL.fullmatch(text):
        try:
            value = float.fromhex(text)
        except OverflowError:
            return None
    else:
        return None
    # For ROS 2 a number that does not fit a double is a string.
    return value if math.isfinite(value) else None
