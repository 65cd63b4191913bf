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
Orders that start a movement: one that waited for long somewhere is refused.

A goal that lay in a socket while the machine was suspended, or was published long before its
mirror was there, sets the robot in motion when its giver does not expect it any more. An order
ages from the moment at which it entered. What stops the robot is never too old.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.base.units import NS_PER_S

ORDER_AGE: Final = Field(
    'order_age_max_s', float, 5.0, 'Age at which an order that comes is refused when it starts a '
    'movement, such as a goal: its giver does not expect it any more', 's', 0.5, 3600.0, live=True,
    before=3600.0)


def why_too_old(stamp_ns: int, now_ns: int, settings: Mapping[str, Any]) -> str:
    """
    Return why an order is refused; empty when it is young enough. Safe in the real-time loop.

    :param stamp_ns: when it entered; a time in the future counts as now.
    """
    age_s = (now_ns - stamp_ns) / NS_PER_S
    if age_s <= settings[ORDER_AGE.name]:
        return ''
    return (f'it was {age_s:.1f} s old when it came (order_age_max_s '
            f'{settings[ORDER_AGE.name]:g}): give it again; are the clocks set?')
