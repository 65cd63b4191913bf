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

"""The ROS types of mirrors, and the samples that mirrors refuse."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
import time
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.link.conversions import TRANSFORMS
from rt_robot_os.settings import MirrorSettings
from rt_robot_os.settings.mirror_types import ros_type
from rt_robot_os.topics.resolve import message_class

_RECENT_NS: Final = 10 * NS_PER_S


def ros_class(mirror: MirrorSettings) -> Any:
    """
    Return the class of a mirror's topic in ROS.

    :raises LayoutError: it is not installed.
    """
    return message_class(ros_type(mirror))


def is_lacking(message: str = TRANSFORMS) -> bool:
    """Return whether the package of a type is not installed, as in the wheels of ROS."""
    return find_spec(message.partition('/')[0]) is None


class Refusals:
    """
    Count the samples that a mirror refuses, and log new reasons.

    At most one line is logged per second.

    :param what: name of the mirror.
    :param log: called with a line of text.
    :ivar count: number of refused samples.
    """

    def __init__(self, what: str, log: Callable[[str], object]) -> None:
        self.count = 0
        self._what = what
        self._log = log
        self._reason = ''
        self._logged = ''
        self._last_ns = self._logged_ns = -_RECENT_NS

    def add(self, reason: str, now_ns: int = 0) -> None:
        """
        Count a sample; the same reason is logged again after ten seconds without it.

        :param now_ns: 0 for the current time.
        """
        now_ns = now_ns or time.monotonic_ns()
        new = reason != self._logged or now_ns - self._last_ns > _RECENT_NS
        if new and now_ns - self._logged_ns >= NS_PER_S:
            self._log(f'{self._what}: refused: {reason}')
            self._logged, self._logged_ns = reason, now_ns
        self.count += 1
        self._reason, self._last_ns = reason, now_ns

    def counters(self) -> dict[str, Any]:
        """Return the count, and for ten seconds the reason of the last one as a warning."""
        recent = self.count and time.monotonic_ns() - self._last_ns <= _RECENT_NS
        return {'refused': self.count, 'warning': f'refused: {self._reason}' if recent else ''}
