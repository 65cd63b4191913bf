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

"""What a mirror does to messages on their way, and whether ROS has their types."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
import time
from typing import Any
from typing import Final

from rt_robot_os.link.conversions import CHECKED
from rt_robot_os.link.conversions import find
from rt_robot_os.link.conversions import Inward
from rt_robot_os.link.conversions import Outward
from rt_robot_os.link.conversions import TRANSFORMS
from rt_robot_os.link.stamped_messages import Header
from rt_robot_os.link.stamped_messages import stamped_type
from rt_robot_os.settings import MirrorSettings
from rt_robot_os.topics.resolve import message_class
from rt_robot_os.units import NS_PER_S

_RECENT_NS: Final = 10 * NS_PER_S


def ros_type(mirror: MirrorSettings) -> str:
    """Name the type that a mirror's topic has in ROS."""
    if mirror.as_:
        return mirror.as_
    return stamped_type(mirror.message) if mirror.stamped else mirror.message


def ros_class(mirror: MirrorSettings) -> Any:
    """
    Return the class of a mirror's topic in ROS.

    :raises LayoutError: there is none.
    """
    return message_class(ros_type(mirror))


def is_lacking(message: str = TRANSFORMS) -> bool:
    """Return whether ROS has no such package here; what the wheels of ROS lack, that is."""
    return find_spec(message.partition('/')[0]) is None


def outward(mirror: MirrorSettings) -> Outward | None:
    """Return what makes a message for ROS from one of the core; None where they are the same."""
    if mirror.stamped:
        return Header(mirror.frame_id).put_on
    conversion = find(mirror.message, mirror.as_)
    if conversion is None or conversion.outward is None:
        return None
    return conversion.outward(mirror.frame_id or conversion.frame_id)


def inward(mirror: MirrorSettings) -> Callable[[int], Inward] | None:
    """
    Find what makes a message for the core from one of ROS; None where they are the same.

    :return: makes it, from the longest message of the core in bytes.
    """
    conversion = find(mirror.message, mirror.as_)
    if conversion is not None and conversion.inward is not None:
        make, frame_id = conversion.inward, mirror.frame_id or conversion.frame_id
    elif mirror.message in CHECKED and not mirror.stamped:
        make, frame_id = CHECKED[mirror.message], mirror.core_frame_id
    else:
        return None
    return lambda maximum_bytes: make(frame_id, maximum_bytes)


class Refusals:
    """
    What a mirror did not let through: counted, and told when there is a new reason for it.

    At most one line a second, whatever comes.

    :param what: names the mirror.
    :param tell: takes a line of text.
    :ivar count: so far.
    """

    def __init__(self, what: str, tell: Callable[[str], object]) -> None:
        self.count = 0
        self._what = what
        self._tell = tell
        self._reason = ''
        self._told = ''
        self._last_ns = self._told_ns = -_RECENT_NS

    def add(self, reason: str, now_ns: int = 0) -> None:
        """
        Count one; the same reason is told again when ten seconds have passed without it.

        :param now_ns: 0 for the time now.
        """
        now_ns = now_ns or time.monotonic_ns()
        new = reason != self._told or now_ns - self._last_ns > _RECENT_NS
        if new and now_ns - self._told_ns >= NS_PER_S:
            self._tell(f'{self._what}: refused: {reason}')
            self._told, self._told_ns = reason, now_ns
        self.count += 1
        self._reason, self._last_ns = reason, now_ns

    def counters(self) -> dict[str, Any]:
        """Return their number, and for ten seconds the reason of the last one as a warning."""
        recent = self.count and time.monotonic_ns() - self._last_ns <= _RECENT_NS
        return {'refused': self.count, 'warning': f'refused: {self._reason}' if recent else ''}
