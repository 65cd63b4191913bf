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

"""Packets as JSON records for programs, and as lines for people."""

from __future__ import annotations

import math
from typing import Any
from typing import Final

from rt_robot_os.base.safe_text import safe_line
from rt_robot_os.features.wsn.cli.captured_packet import CapturedPacket
from rt_robot_os.features.wsn.packets.decode import Packet
from rt_robot_os.features.wsn.packets.multihop_lqi import NO_PARENT
from rt_robot_os.features.wsn.packets.multihop_lqi import NO_ROUTE_HOPS

# Fields of a record, in this order; null where the packet does not have them.
_NUMBERS: Final = {
    'am_type': 'am_type', 'group': 'group', 'destination': 'destination', 'source': 'source',
    'origin': 'origin', 'seqno': 'origin_seqno', 'hops': 'hops', 'parent': 'parent',
    'cost': 'cost'}
_SHOWN: Final = (('from', 'source'), ('to', 'destination'), ('origin', 'origin'),
                 ('seqno', 'seqno'), ('count', 'count'), ('hops', 'hops'), ('parent', 'parent'),
                 ('cost', 'cost'))
_ALL: Final = 0xFFFF
_NONE: Final = {'parent': NO_PARENT, 'hops': NO_ROUTE_HOPS}


def record_of(captured: CapturedPacket, packet: Packet, again: bool) -> dict[str, Any]:
    """
    Return the record of a packet for ``wsn sniff --json``.

    :param again: it is a duplicate.
    """
    found: dict[str, Any] = {
        'time': captured.time_s, 'medium': captured.medium, 'protocol': packet.stack or None,
        'platform': packet.platform or None, 'kind': packet.kind, 'name': packet.name or None}
    for key, name in _NUMBERS.items():
        value = getattr(packet, name)
        found[key] = value if value >= 0 else None
    found['count'] = packet.count if packet.count_bits else None
    found['duplicate'] = again
    found['fields'] = finite(packet.fields)
    found['readings'] = dict(packet.readings)
    found['problem'] = packet.problem or None
    found['hex'] = captured.data.hex()
    return found


def line_of(record: dict[str, Any]) -> str:
    """Return a record as a line."""
    time_s = '' if record['time'] is None else f'{record["time"]:.6f}'
    am_type = '    ' if record['am_type'] is None else f'0x{record["am_type"]:02x}'
    name = record['name'] or record['kind']
    parts = [f'{time_s:>17} {record["protocol"] or record["medium"]:7} {am_type} {name:<20}']
    for title, key in _SHOWN:
        if record[key] is not None and not (title == 'to' and record[key] == _ALL):
            parts.append(f'{title} {_number(title, record[key])}')
    shown = {key for _, key in _SHOWN} | {'originseqno', 'seq_no'}
    parts += [f'{name}={_text(value)}' for name, value in record['readings'].items()]
    parts += [f'{name} {_text(value)}' for name, value in record['fields'].items()
              if name not in shown]
    if record['kind'] == 'unknown':
        parts.append(record['hex'])
    if record['duplicate']:
        parts.append('(again)')
    if record['problem']:
        parts.append(f'! {record["problem"]}')
    return safe_line(' '.join(parts), 1000).rstrip()


def finite(value: Any) -> Any:
    """Replace infinities and NaN, which JSON does not have, by None."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: finite(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(each) for each in value]
    return value


def _number(title: str, value: int) -> str:
    """Return a number as text; without a route there is no parent, and no hop count."""
    return 'none' if value == _NONE.get(title) else str(value)


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f'{value:.5g}'
    if isinstance(value, list):
        return ' '.join(_text(each) for each in value) if value else '-'
    if isinstance(value, dict):
        return '/'.join(_text(each) for each in value.values())
    return str(value)
