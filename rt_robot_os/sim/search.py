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

"""Raw readings for physical values: the inverse of a compensation, by search."""

from __future__ import annotations

from collections.abc import Callable


def invert(function: Callable[[int], float], value: float, low: int, high: int) -> int:
    """
    Find the argument whose result is nearest to a value.

    :param function: rises or falls all the way from ``low`` to ``high``.
    :return: an argument within the limits; one of them when the value lies beyond.
    """
    sign = 1.0 if function(high) >= function(low) else -1.0
    wanted = sign * value
    below, above = low, high
    while above - below > 1:
        middle = (below + above) // 2
        if sign * function(middle) <= wanted:
            below = middle
        else:
            above = middle
    return min((below, above), key=lambda each: abs(sign * function(each) - wanted))
