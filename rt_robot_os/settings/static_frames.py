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
The mountings of the configuration as messages of ``/tf_static``.

Used by the node and by the recorder.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Sequence
from typing import Final

from rt_robot_os.link.conversions import transform
from rt_robot_os.link.conversions import transforms_of
from rt_robot_os.motion.mounting import BASE_FRAME
from rt_robot_os.settings.model import MountedFrame
from rt_robot_os.settings.model import RobotSettings

#: As tf2_ros.StaticTransformBroadcaster: reliable and transient_local, with this depth.
TOPIC: Final = '/tf_static'
DEPTH: Final = 1


def published_frames(settings: RobotSettings) -> tuple[MountedFrame, ...]:
    """Return the frames that a robot's node publishes, according to ``static_transforms``."""
    which = settings.static_transforms
    return tuple(each for each in settings.frames
                 if which == 'all' or which == 'mounted' and each.stated)


def loose_parents(frames: Sequence[MountedFrame]) -> tuple[str, ...]:
    """Return the parent frames that have no mounting themselves, except the robot's base."""
    known = {each.frame_id for each in frames} | {BASE_FRAME}
    return tuple(dict.fromkeys(
        each.mounting.parent for each in frames if each.mounting.parent not in known))


def static_transforms(frames: Iterable[MountedFrame], wall_ns: int) -> bytes:
    """
    Write all frames as one ``tf2_msgs/msg/TFMessage``, as CDR.

    :param wall_ns: since 1970.
    """
    return transforms_of([
        transform(each.mounting.parent, each.frame_id,
                  (*each.mounting.position_m, *each.mounting.quaternion()), wall_ns)
        for each in frames])
