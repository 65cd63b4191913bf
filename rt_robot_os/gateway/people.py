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

"""The people about whom a robot has topics: ``health/<person>/<sign>``."""

from __future__ import annotations

from collections.abc import Iterable

from rt_robot_os.base.schema import star_match


def people_in(topics: Iterable[str]) -> tuple[str, ...]:
    """Return the people of some topics, in alphabetical order."""
    return tuple(sorted({topic.split('/')[1] for topic in topics
                         if star_match('health/*/*', topic) is not None}))
