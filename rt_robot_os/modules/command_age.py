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
Rejection of stale commands that start a movement.

A goal that waited in a socket while the machine was suspended, or was published long before its
mirror existed, would move the robot when its sender no longer expects that. The age of a command
counts from the moment at which it entered the system. A command that stops the robot is never
stale.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.base.units import NS_PER_S

COMMAND_AGE: Final = Field(
    'order_age_max_s', float, 5.0, 'Maximum age of a command that starts a movement, such as a '
    'goal; an older one is rejected, as its sender no longer expects it', 's', 0.5, 3600.0,
    live=True, before=3600.0)


def stale_reason(stamp_ns: int, now_ns: int, settings: Mapping[str, Any]) -> str:
    """
    Return why a command is rejected; empty when it is recent. Safe in the real-time loop.

    :param stamp_ns: when it entered the system; a time in the future counts as now.
    """
    age_s = (now_ns - stamp_ns) / NS_PER_S
    if age_s <= settings[COMMAND_AGE.name]:
        return ''
    return (f'it was {age_s:.1f} s old when it came (order_age_max_s '
            f'{settings[COMMAND_AGE.name]:g}): give it again; are the clocks set?')
