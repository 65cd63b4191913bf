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

"""The time from which on each level of the observations is available."""

from __future__ import annotations

from rt_robot_os.monitor.store.rollups import progress
from sqlalchemy import Connection


def horizon_name(level: str) -> str:
    """Return the name of its counter."""
    return f'from:{level}'


def horizon(connection: Connection, level: str) -> int:
    """Return this time, UTC in ns; older rows were deleted. 0: nothing was deleted."""
    return progress(connection, horizon_name(level))
