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
The ROS types of mirrored topics, and the converters of their messages.

Used by the node and by the recorder: a bag has the types of the live graph.
"""

from __future__ import annotations

from collections.abc import Callable

from rt_robot_os.link.conversions import CHECKED
from rt_robot_os.link.conversions import find
from rt_robot_os.link.conversions import Inward
from rt_robot_os.link.conversions import Outward
from rt_robot_os.link.stamped_messages import HeaderWriter
from rt_robot_os.link.stamped_messages import stamped_type
from rt_robot_os.settings.model import MirrorSettings


def ros_type(mirror: MirrorSettings) -> str:
    """Return the type of a mirror's topic in ROS."""
    if mirror.as_:
        return mirror.as_
    return stamped_type(mirror.message) if mirror.stamped else mirror.message


def outward(mirror: MirrorSettings) -> Outward | None:
    """
    Return the converter from messages of the core to those of ROS; None if they are the same.

    Also for a mirror from ROS: a recording shows what the core received as it was sent.

    :raises ValueError: there is no such conversion.
    """
    if mirror.stamped:
        return HeaderWriter(mirror.frame_id).put_on
    if not mirror.as_:
        return None
    conversion = find(mirror.message, mirror.as_)
    if conversion is None or conversion.outward is None:
        raise ValueError(f'mirror {mirror.name}: {mirror.message} cannot be converted to '
                         f'{mirror.as_}')
    return conversion.outward(mirror.frame_id or conversion.frame_id)


def inward(mirror: MirrorSettings) -> Callable[[int], Inward] | None:
    """
    Return the factory of the converter from messages of ROS; None if they are the same.

    :return: makes the converter, from the longest message of the core in bytes.
    """
    conversion = find(mirror.message, mirror.as_)
    if conversion is not None and conversion.inward is not None:
        make, frame_id = conversion.inward, mirror.frame_id or conversion.frame_id
    elif mirror.message in CHECKED and not mirror.stamped:
        make, frame_id = CHECKED[mirror.message], mirror.core_frame_id
    else:
        return None
    return lambda maximum_bytes: make(frame_id, maximum_bytes)
