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

"""Estimates the memory of a value parsed from JSON, to bound the memory used by a robot."""

from __future__ import annotations

from typing import Any
from typing import Final

# CPython on 64 bits, rounded up: an object, one more element of a list, one more of a dict.
_OBJECT: Final = 64
_ELEMENT: Final = 8
_MEMBER: Final = 104


def memory_of(value: Any, most: int) -> int:
    """
    Return the approximate size of a JSON value in bytes; stops at ``most``.

    Characters beyond ASCII count 6 bytes each, as in the messages to the page.
    """
    size = 0
    left = [value]
    while left and size <= most:
        one = left.pop()
        size += _OBJECT
        if isinstance(one, str):
            size += len(one) * (1 if one.isascii() else 6)
        elif isinstance(one, dict):
            size += _MEMBER * len(one)
            left.extend(one)
            left.extend(one.values())
        elif isinstance(one, list):
            size += _ELEMENT * len(one)
            if size <= most:
                left.extend(one)
    return size
