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

"""The settings of the mounting of a device's frame on the robot, for all devices."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.motion.mounting import BASE_FRAME

FRAME_SETTING: Final = 'frame_id'
_ORIGIN: Final = (0.0, 0.0, 0.0)


def mounting_settings(*, length: int = 3, whose: str = 'frame_id', more: str = ''
                      ) -> tuple[Field, ...]:
    """
    Declare the mounting of a device; one with a setting ``frame_id`` has these automatically.

    :param length: of the two lists; 0 for a device with several frames, which checks them.
    :param whose: the setting that names the frame which is mounted.
    :param more: an addition to their descriptions.
    """
    return (
        Field('mounting_m', list, _ORIGIN,
              f'Position of {whose} in parent_frame_id: x ahead, y to the left, z up{more}.',
              'm', item=float, length=length),
        Field('mounting_rad', list, _ORIGIN,
              'Its rotation there, as in URDF: roll, pitch, yaw about the fixed axes x, y, z.',
              'rad', item=float, length=length),
        Field('parent_frame_id', str, BASE_FRAME, 'The frame on which it is mounted.'),
    )


def with_mounting(fields: tuple[Field, ...]) -> tuple[Field, ...]:
    """Add the settings of the mounting after the frame, if it exists and they are missing."""
    return tuple(_with_mounting(fields))


def _with_mounting(fields: tuple[Field, ...]) -> Iterator[Field]:
    given = {each.name for each in fields}
    for each in fields:
        yield each
        if each.name == FRAME_SETTING:
            yield from (one for one in mounting_settings() if one.name not in given)
