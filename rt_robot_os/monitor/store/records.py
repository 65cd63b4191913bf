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
Validation of a robot's records: each becomes a row of a table, or is stored aside with a reason.

A record of a newer release, with an invalid number or a string that no database accepts, does not
affect others: it is stored aside, truncated, and the other records of the batch are stored.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from dataclasses import dataclass
import json
import math
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.safe_text import encodable
from rt_robot_os.base.safe_text import safe_text
from rt_robot_os.messages.quantities import NAME
from rt_robot_os.monitor.store.robot_clock import RobotClock
from rt_robot_os.monitor.store.tables import NAME as NAME_LONGEST

#: The number of a quality in the database is its index here.
QUALITIES: Final = ('good', 'suspect', 'stale', 'off', 'missing')
#: Qualities of values that were measured at the time of the record; only these count in roll-ups.
MEASURED: Final = frozenset({0, 1})
MISSING: Final = QUALITIES.index('missing')
CONTENT_BYTES: Final = 32768
KEPT_CHARACTERS: Final = 2000
SEQ_MOST: Final = 1 << 53
TEXT_LONGEST: Final = 4000
_INT_MOST: Final = (1 << 63) - 1
_NO_VALUE: Final = frozenset({QUALITIES.index('off'), MISSING})


class Refused(ValueError):
    """A record is invalid; the message gives the reason."""


class Sent(NamedTuple):
    """
    A valid record.

    :ivar table: the name of the table it goes to.
    :ivar row: its columns without the key and the ids of other tables.
    :ivar person: the person it is about, or ''.
    :ivar code: the sign of an observation, or ''.
    :ivar clock_error_ns: how far the robot's clock was ahead if the time was corrected; else 0.
    """

    seq: int
    table: str
    row: dict[str, Any]
    person: str = ''
    code: str = ''
    clock_error_ns: int = 0


@dataclass(frozen=True)
class Aside:
    """An invalid record; ``seq`` is None when it cannot be read."""

    seq: int | None
    type: str  # noqa: A003
    why: str
    content: str


def read(record: object, now_ns: int, clock: RobotClock = RobotClock()) -> Sent | Aside:
    """
    Check a record; never raises.

    :param now_ns: UTC of the server.
    :param clock: the robot's clock.
    """
    seq = None
    try:
        if not isinstance(record, Mapping):
            raise Refused(f'a {type(record).__name__} is not a record')
        seq = _integer(record, 'seq', 0, SEQ_MOST)
        reader = _READERS.get(record.get('type', ''))
        if reader is None:
            raise Refused('of a type that this release does not know')
        content = record.get('content')
        if not isinstance(content, Mapping):
            raise Refused('content is not an object')
        t_ns = _integer(record, 'utc_ns', -_INT_MOST, _INT_MOST)
        at_ns = clock.corrected(t_ns, now_ns)
        return _marked(reader(seq, at_ns, content), t_ns - at_ns)
    except (Refused, TypeError, RecursionError) as error:
        return Aside(seq, _loose(record, 'type'), str(error)[:200], _as_it_came(record))


def _marked(sent: Sent, clock_error_ns: int) -> Sent:
    """Return a record with the error of the robot's clock; good values become suspect."""
    if not clock_error_ns:
        return sent
    if sent.row.get('quality') == QUALITIES.index('good'):
        sent.row['quality'] = QUALITIES.index('suspect')
    return sent._replace(clock_error_ns=clock_error_ns)


def _alarm_event(seq: int, t_ns: int, content: Mapping[str, Any]) -> Sent:
    content = _clean(content)
    return Sent(seq, 'alarm_events', {
        't_ns': t_ns, 'alarm': _name(content, 'alarm'), 'subject': _name(content, 'subject', ''),
        'event_seq': _integer(content, 'seq', 0, _INT_MOST), 'event': _name(content, 'event'),
        'state': _name(content, 'state'), 'level': _name(content, 'level'),
        'content': _json(content)})


def _event(kind: str) -> Callable[[int, int, Mapping[str, Any]], Sent]:
    def read_event(seq: int, t_ns: int, content: Mapping[str, Any]) -> Sent:
        return Sent(seq, 'events', {'t_ns': t_ns, 'type': kind, 'content': _json(content)})
    return read_event


def _observation(seq: int, t_ns: int, content: Mapping[str, Any]) -> Sent:
    sign = content.get('sign')
    if not isinstance(sign, str) or not NAME.fullmatch(sign):
        raise Refused('sign is not a name such as pulse_per_min')
    return _value(seq, t_ns, content, sign, content.get('value'))


def _news2(seq: int, t_ns: int, content: Mapping[str, Any]) -> Sent:
    total = content.get('value', content.get('total'))
    if total is None or total == -1:
        return _value(seq, t_ns, {**content, 'quality': 'missing'}, 'news2', None)
    return _value(seq, t_ns, content, 'news2', total)


def _value(seq: int, t_ns: int, content: Mapping[str, Any], sign: str, value: object) -> Sent:
    quality = content.get('quality', 'good')
    if quality not in QUALITIES:
        raise Refused(f'quality is none of {", ".join(QUALITIES)}')
    number = QUALITIES.index(quality)
    if number in _NO_VALUE:
        value = None
    elif value is None and quality != 'stale':
        raise Refused(f'quality is {quality}, but there is no value')
    return Sent(seq, 'observations', {
        't_ns': t_ns, 'value': None if value is None else _float(value, 'value'),
        'quality': number, 'source': _name(content, 'source', '')},
        _name(content, 'person'), sign)


def _place(seq: int, t_ns: int, content: Mapping[str, Any]) -> Sent:
    return Sent(seq, 'places', {
        't_ns': t_ns, 'x': _optional(content, 'x'), 'y': _optional(content, 'y'),
        'room': _name(content, 'room', '')}, _name(content, 'person'))


def _node(seq: int, t_ns: int, content: Mapping[str, Any]) -> Sent:
    node = content.get('node')
    if isinstance(node, int) and not isinstance(node, bool):
        content = {**content, 'node': str(node)}
    return Sent(seq, 'nodes', {
        't_ns': t_ns, 'node': _name(content, 'node'), 'content': _json(content)})


def _media(seq: int, t_ns: int, content: Mapping[str, Any]) -> Sent:
    alarm = content.get('alarm')
    return Sent(seq, 'media', {
        't_ns': t_ns, 'media': _name(content, 'id'),
        'alarm': '' if alarm is None else _name(content, 'alarm', ''),
        'kind': _name(content, 'kind', ''), 'file': _text(content, 'file'),
        'sha256': _name(content, 'sha256', ''), 'size': _integer(content, 'size', 0, 1 << 40),
        'width': _integer(content, 'width', 0, 1 << 20, 0),
        'height': _integer(content, 'height', 0, 1 << 20, 0)})


_READERS: Final[dict[str, Callable[[int, int, Mapping[str, Any]], Sent]]] = {
    'alarm_event': _alarm_event, 'transition': _event('transition'), 'log': _event('log'),
    'event': _event('event'), 'observation': _observation, 'news2': _news2, 'place': _place,
    'node': _node, 'media': _media}


# ---- values ------------------------------------------------------------------------------------

def _integer(found: Mapping[str, Any], name: str, low: int, high: int,
             default: int | None = None) -> int:
    value = found.get(name, default)
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if not isinstance(value, int) or isinstance(value, bool):
        raise Refused(f'{name} is not an integer')
    if not low <= value <= high:
        raise Refused(f'{name} is not between {low} and {high}')
    return value


def _float(value: object, name: str) -> float:
    if not isinstance(value, (int, float)) or isinstance(value, bool):
        raise Refused(f'{name} is not a number')
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not -1e15 < number < 1e15:
        raise Refused(f'{name} is not finite, or too large')
    return number


def _optional(found: Mapping[str, Any], name: str) -> float | None:
    value = found.get(name)
    return None if value is None else _float(value, name)


def _name(found: Mapping[str, Any], name: str, default: str | None = None) -> str:
    value = found.get(name, default)
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) <= _INT_MOST:
        value = str(value)
    if not isinstance(value, str) or (not value and default is None):
        raise Refused(f'{name} is not a string')
    if len(value) > NAME_LONGEST:
        raise Refused(f'{name} has {len(value)} characters; at most {NAME_LONGEST}')
    # Names are displayed: no control characters, lone surrogates or changes of direction.
    if not value.isprintable():
        raise Refused(f'{name} has unprintable characters')
    return value


def _text(found: Mapping[str, Any], name: str) -> str:
    value = found.get(name, '')
    if not isinstance(value, str) or len(value) > TEXT_LONGEST:
        raise Refused(f'{name} is not a string of at most {TEXT_LONGEST} characters')
    if '\0' in value or not encodable(value):
        raise Refused(f'{name} has NUL or a lone surrogate')
    return value


def _json(content: Mapping[str, Any]) -> str:
    """Serialise a content, without characters that a database or a page cannot store."""
    try:
        text = json.dumps(_clean(content), allow_nan=False, ensure_ascii=False,
                          separators=(',', ':'))
    except ValueError as error:
        raise Refused('a number in it is not finite') from error
    if len(text) > CONTENT_BYTES:
        raise Refused(f'content of {len(text)} characters; at most {CONTENT_BYTES}')
    return text


def _clean(found: Any) -> Any:
    """Return it with control characters and lone surrogates as escapes."""
    if isinstance(found, str):
        return safe_text(found)
    if isinstance(found, Mapping):
        return {safe_text(str(name)): _clean(value) for name, value in found.items()}
    return [_clean(each) for each in found] if isinstance(found, (list, tuple)) else found


def _loose(record: object, name: str) -> str:
    value = record.get(name, '') if isinstance(record, Mapping) else ''
    return safe_text(value[:NAME_LONGEST // 6]) if isinstance(value, str) else ''


def _as_it_came(record: object) -> str:
    try:
        return json.dumps(record)[:KEPT_CHARACTERS]
    except (TypeError, ValueError, RecursionError):
        return safe_text(repr(type(record)))
