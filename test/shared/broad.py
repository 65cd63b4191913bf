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

"""How many examples a check takes: few in the suite, a million when somebody asks for that."""

from __future__ import annotations

import os

#: Set it to 1, or to a number of examples, for a check before a release.
VARIABLE = 'RT_ROBOT_OS_BROAD'
MANY = 1_000_000


def examples(few: int) -> int:
    """Give the number of examples to try."""
    asked = os.environ.get(VARIABLE, '')
    if not asked:
        return few
    return int(asked) if asked.isdigit() and int(asked) > 1 else MANY
