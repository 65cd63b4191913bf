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

Not a heap: that compares its way to the bottom each time that its first is removed. Here a timer
that is inserted anew comes last at its level, as a rule, and there is little to move.
"""

from __future__ import annotations

from bisect import insort
from typing import Any
from typing import Final

from rt_robot_os.kernel.clock import NEVER_NS

# (time, order among equals, task or action, period until then; 0: it comes once)
Timer = tuple[int, int, Any, int]

# At the end of each list: they spare the question whether it has so many.
SENTINELS: Final[list[Timer]] = [(NEVER_NS, (1 << 60) + order, None, 0) for order in range(3)]

insert = insort
