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

"""Signals as robots send them to the monitor."""

from __future__ import annotations

from typing import Any

NODES = {'nodes': [
    {'id': 0, 'name': 'sink', 'state': 6, 'parent': -1, 'hops': 0, 'battery_v': 5.0, 'age_s': 0},
    {'id': 3, 'name': 'washer', 'state': 2, 'parent': 0, 'hops': 1, 'battery_v': 2.3,
     'days_left': 9, 'delivery': 0.71, 'recent': 0.71, 'received': 812, 'lost': 331, 'age_s': 5},
    {'id': 5, 'name': 'study', 'state': 3, 'parent': 3, 'hops': 2, 'battery_v': 2.6,
     'days_left': 80, 'delivery': 0.93, 'recent': 0.9, 'received': 12, 'lost': 1, 'age_s': 214}]}


def signs(**values: float) -> dict[str, Any]:
    """Return the message of a person's signs, as the robot publishes it."""
    return {'status': [{
        'level': 0, 'name': f'anna/{name}', 'message': f'{value:g}', 'hardware_id': 'wrist',
        'values': {'value': f'{value:g}', 'unit': '', 'quality': 'good', 'age_s': '0.5',
                   'source': 'wrist', 'stamp_ns': '1'}} for name, value in values.items()]}


def news2(total: int | str, risk: str) -> dict[str, Any]:
    """Return the message of a person's score."""
    return {'status': [{'level': 0, 'name': 'anna/news2', 'message': '', 'hardware_id': '',
                        'values': {'total': str(total), 'complete': 'true', 'missing': '',
                                   'at_least': str(total), 'risk': risk}}]}
