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

"""Tell a packet that was here from one that is new."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable


class Seen:
    """
    What was seen not too long ago.

    Numbers start anew when a node boots, so that nothing is remembered longer than copies of a
    packet can be on their way.

    :param most: the oldest is forgotten beyond that.
    :param memory_ns: what is older is new again.
    """

    __slots__ = ('_most', '_memory_ns', '_times')

    def __init__(self, most: int, memory_ns: int) -> None:
        self._most = most
        self._memory_ns = memory_ns
        self._times: OrderedDict[Hashable, int] = OrderedDict()

    def known(self, key: Hashable, now_ns: int) -> bool:
        """Tell whether it was seen."""
        then_ns = self._times.get(key)
        return then_ns is not None and now_ns - then_ns <= self._memory_ns

    def add(self, key: Hashable, now_ns: int) -> None:
        """See it."""
        self._times[key] = now_ns
        self._times.move_to_end(key)
        if len(self._times) > self._most:
            self._times.popitem(last=False)
