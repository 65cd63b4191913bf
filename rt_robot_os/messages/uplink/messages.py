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
The messages between a gateway and a server, as text: JSON objects with a ``kind``.

A robot has two connections. ``/robot/state`` carries these; ``/robot/media`` carries pictures
(:mod:`rt_robot_os.messages.uplink.frames`), so that no alarm ever waits behind one. Each side
answers what it does not know with nothing, and counts it: an older robot can talk to a newer
server.

==========  =========  ==========================================================================
kind        direction  content
==========  =========  ==========================================================================
hello       up         version, robot (UUID), name, boot (UUID of this start), utc_ns, people,
                       cameras, capabilities, nodes, map (SHA-256), limits
records     up         batch, boot (of these records; an earlier start's after a restart), records
                       (each: seq, importance, type, utc_ns, content), lost ({importance: how many
                       records gave way so far})
live        up         n, utc_ns, signals ({name: [utc_ns, value]})
answer      up         id, ok, text
map         up         a map, as :mod:`.maps` packs it; after want_map, and when
                       the robot has another one
beat        up         n, utc_ns; while somebody may drive also lease, motion, ...: n is the
                       ticket that a command to drive must carry
welcome     down       utc_ns, want_map
stored      down       batch: it is on the server's disk
refused     down       batch, text, retry_s
taken       down       n: the next ``live`` may come
want        down       signals_hz, cameras ({name: pictures a second}), signals (patterns of
                       names that somebody looks at; optional)
command     down       id, do, args, by
drive_begin down       lease, by: this one may drive from now on
drive       down       lease, seq, beat, held_ms, grip, linear_m_s, angular_rad_s, by
drive_end   down       lease, by, why
voice       both       call, what the two ends of a call say to set it up
==========  =========  ==========================================================================
"""

from __future__ import annotations

from collections.abc import Mapping
import json
from typing import Any
from typing import Final

#: Raised when a message changes so that an older program would misread it.
VERSION: Final = 1
#: The longest text either side takes.
MESSAGE_BYTES: Final = 1 << 20

#: Kinds that go up, and down.
UP: Final = frozenset({'hello', 'records', 'live', 'answer', 'map', 'beat', 'voice'})
DOWN: Final = frozenset({'welcome', 'stored', 'refused', 'taken', 'want', 'command',
                         'drive_begin', 'drive', 'drive_end', 'voice'})


def encode(kind: str, content: Mapping[str, Any]) -> str:
    """
    Write a message.

    :raises ValueError: a number is not finite, which JSON cannot hold.
    """
    return json.dumps({'kind': kind, **content}, ensure_ascii=False, allow_nan=False,
                      separators=(',', ':'))


def decode(text: str | bytes) -> dict[str, Any]:
    """
    Read a message.

    :return: it, with ``kind`` a text.
    :raises ValueError: it is none: too long, no JSON, no object, without a kind, or with a
        number that is not finite.
    """
    if len(text) > MESSAGE_BYTES:
        raise ValueError(f'a message of {len(text)} bytes; {MESSAGE_BYTES} are the most')
    try:
        found = json.loads(text, parse_constant=_refuse)
    except RecursionError:
        raise ValueError('a message that is nested too deeply') from None
    except UnicodeDecodeError as error:
        raise ValueError(f'a message that is no UTF-8: {error.reason}') from None
    if not isinstance(found, dict) or not isinstance(found.get('kind'), str):
        raise ValueError('a message without a kind')
    return found


def _refuse(name: str) -> float:
    raise ValueError(f'a message with {name}, which JSON does not have')
