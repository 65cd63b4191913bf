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

"""What a notification says about an alarm, for people."""

from __future__ import annotations

from rt_robot_os.features.alarms.alarm import Alarm


def sentence_of(alarm: Alarm) -> str:
    """Return a sentence that describes an alarm."""
    kinds = ', '.join(alarm.kinds)
    about = f'{kinds}: {alarm.text}' if alarm.text else kinds
    again = f' (again: {alarm.why})' if alarm.round > 1 and alarm.why else ''
    remark = f'; {alarm.remark}' if alarm.remark else ''
    test = 'TEST, nothing has happened: ' if alarm.is_test else ''
    text = f'{test}{alarm.level.name} alarm {alarm.id}, {alarm.subject}: {about}{again}{remark}'
    return text[:400]
