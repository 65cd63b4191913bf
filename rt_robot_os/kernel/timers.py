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
What falls due at a level: a sorted list, the first that falls due at its beginning.

A heap would be compared with itself to its bottom each time that its first is taken. Here a timer
that has its next turn is, as a rule, the last of its level, and is compared with one other.
"""

from __future__ import annotations

from bisect import insort
from typing import Any
from typing import Final

from rt_robot_os.kernel.clock import NEVER_NS

# (time, order among equals, task or action, period in force until then; 0: it comes once)
Timer = tuple[Any, ...]  # of any length: of others mypyc copies all whenever one is looked at

# They spare the question whether there are as many.
SENTINELS: Final[list[Timer]] = [(NEVER_NS, (1 << 60) + order, None, 0) for order in range(3)]


def insert(entries: list[Any], entry: tuple[Any, ...]) -> None:
    """
    Put an entry in its place among others, which are sorted and end with three sentinels.

    As a rule that is behind all others, or before them where they fall due together.
    """
    # Times are compared first: whole tuples only where they are the same.
    due_ns: int = entry[0]
    near: tuple[Any, ...] = entries[0]
    near_ns: int = near[0]
    if due_ns < near_ns or due_ns == near_ns and entry < near:
        entries.insert(0, entry)
        return
    near = entries[-4]
    near_ns = near[0]
    if near_ns < due_ns or due_ns == near_ns and near < entry:
        entries.insert(-3, entry)
    else:
        insort(entries, entry)
