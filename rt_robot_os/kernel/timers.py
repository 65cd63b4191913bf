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
The timers of a level: a list that is sorted by due time.

It is not a heap: a heap compares down to a leaf each time that its first element is removed. Here
a timer that is inserted again usually comes last at its level, and little has to be moved.
"""

from __future__ import annotations

from bisect import insort
from typing import Any
from typing import Final

from rt_robot_os.kernel.clock import NEVER_NS

# (due time, order among equals, task or action, period before it; 0 for a one-shot timer)
Timer = tuple[int, int, Any, int]

# At the end of each list, so that the first three need no check of the length.
SENTINELS: Final[list[Timer]] = [(NEVER_NS, (1 << 60) + order, None, 0) for order in range(3)]

insert = insort
