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

"""The list of open alarms, as a ``diagnostic_msgs/msg/DiagnosticArray`` in JSON."""

from __future__ import annotations

from collections.abc import Iterable
import math
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.alarms.alarm import Alarm
from rt_robot_os.messages.alarm_state import AlarmState
from rt_robot_os.messages.cause import Level
from rt_robot_os.messages.fields import compact

#: The longest list, in bytes.
LIST_BYTES: Final = 60_000
_OK, _WARN, _ERROR = 0, 1, 2
_SEVERITY: Final = {Level.TECHNICAL: _WARN, Level.WARNING: _WARN, Level.URGENT: _ERROR,
                    Level.CRITICAL: _ERROR}


def list_text(alarms: Iterable[Alarm], now_ns: int) -> str:
    """Write the list, the worst first; what does not fit is left out at the end, and counted."""
    found = [_status(each, now_ns) for each in alarms]
    if not found:
        found = [_plain(_OK, 'no alarm')]
    left_out = 0
    while True:
        more = [_plain(_ERROR, f'{left_out} more')] if left_out else []
        text = compact({'status': [*found, *more]})
        if len(text.encode()) <= LIST_BYTES:
            return text
        found.pop()
        left_out += 1


def _plain(level: int, message: str) -> dict[str, Any]:
    return {'level': level, 'name': 'alarms', 'message': message, 'hardware_id': '', 'values': {}}


def _status(alarm: Alarm, now_ns: int) -> dict[str, Any]:
    lasting = [each.kind for each in alarm.reasons.values() if each.active]
    by = f' by {alarm.by}' if alarm.state is AlarmState.ACKNOWLEDGED else ''
    values = {
        'id': alarm.id, 'state': alarm.state.value, 'level': alarm.level.name.lower(),
        'subject': alarm.subject, 'kinds': ' '.join(alarm.kinds), 'lasting': ' '.join(lasting),
        'count': str(sum(each.count for each in alarm.reasons.values())),
        'age_s': _age_s(now_ns, alarm.opened_ns), 'state_age_s': _age_s(now_ns, alarm.state_ns),
        'by': alarm.by, 'step': str(alarm.step + 1), 'top': str(alarm.top).lower(),
        'told': ' '.join(dict.fromkeys(
            each.channel for each in alarm.deliveries.values() if each.ok)),
        'failed': ' '.join(dict.fromkeys(
            each.channel for each in alarm.deliveries.values() if each.ok is False)),
        'node': alarm.node}
    if math.isfinite(alarm.x):
        values.update({'x': f'{alarm.x:.2f}', 'y': f'{alarm.y:.2f}'})
    return {'level': _SEVERITY[alarm.level], 'name': f'alarm {alarm.id}: {alarm.subject}',
            'message': f'{alarm.state.value}{by}: {", ".join(alarm.kinds)}'
            + (f': {alarm.text}' if alarm.text else ''),
            'hardware_id': alarm.subject,
            'values': {key: value for key, value in values.items() if value}}


def _age_s(now_ns: int, since_ns: int) -> str:
    return f'{max(0, now_ns - since_ns) / NS_PER_S:.0f}'
