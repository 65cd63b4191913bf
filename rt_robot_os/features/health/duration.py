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

"""Parser of durations: ``60 s``, ``10 min``, ``12 h``."""

from __future__ import annotations

import re
from typing import Final

_UNITS_S: Final = {'s': 1.0, 'min': 60.0, 'h': 3600.0, 'd': 86_400.0}
_FORM: Final = re.compile(r'([0-9]{1,9}(?:\.[0-9]{1,9})?)\s*(s|min|h|d)')
_NS_PER_S: Final = 1_000_000_000


def duration_ns(text: str) -> int:
    """
    Parse a duration.

    :return: nanoseconds.
    :raises ValueError: the string is not a duration.
    """
    found = _FORM.fullmatch(text.strip())
    if not found:
        raise ValueError(f'{text[:40]!r} is not a duration: write a number and s, min, h or d, '
                         'such as 60 s')
    return round(float(found[1]) * _UNITS_S[found[2]] * _NS_PER_S)
