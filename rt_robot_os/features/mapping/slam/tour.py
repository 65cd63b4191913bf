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

"""The shortest path through some places, from the present one."""

from __future__ import annotations

from collections.abc import Sequence
import math

from rt_robot_os.features.mapping.slam.transforms import Floats


def first_of_tour(ways: Sequence[float], between: Floats, ends: Sequence[float]) -> int:
    """
    Return the first place of the shortest path through all of them.

    Held and Karp's dynamic programme: exact, 2 ** n * n * n steps.

    :param ways: distance from the present place to each place, in m.
    :param between: from place to place in m; shape (places, places).
    :param ends: cost of ending at each place, in m.
    """
    count = len(ways)
    apart = between.tolist()
    # The shortest path through a set of places, as bits, from one of them on.
    after: list[list[float]] = [[math.inf] * count for _ in range(1 << count)]
    for place in range(count):
        after[1 << place][place] = ends[place]
    for places in range(1, 1 << count):
        inner = [place for place in range(count) if places >> place & 1]
        if len(inner) > 1:
            row = after[places]
            for place in inner:
                rest = after[places ^ 1 << place]
                steps = apart[place]
                row[place] = min(steps[other] + rest[other] for other in inner
                                 if other != place)
    whole = after[-1]
    return min(range(count), key=lambda place: ways[place] + whole[place])
