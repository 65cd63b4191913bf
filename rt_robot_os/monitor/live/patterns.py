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
Names with ``*`` for any characters, compared in time that grows with the name's length alone.

A regular expression for ``*a*b*`` tries every split of a name among its stars. Here each part
between two stars is searched once, after the first occurrence of the previous part: if any match
exists, the leftmost one does.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Collection


def matcher(patterns: Collection[str]) -> Callable[[str], bool]:
    """Return a function that returns whether one of these matches a name."""
    names = frozenset(each for each in patterns if '*' not in each)
    parts = [each.split('*') for each in patterns if '*' in each]
    if any(not any(each) for each in parts):
        return lambda name: True
    return lambda name: name in names or any(_matches(each, name) for each in parts)


def _matches(parts: list[str], name: str) -> bool:
    first, *middle, last = parts
    end = len(name) - len(last)
    at = len(first)
    if at > end or not name.startswith(first) or not name.endswith(last):
        return False
    for each in middle:
        at = name.find(each, at, end)
        if at < 0:
            return False
        at += len(each)
    return True
