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


"""What a client learns of a core: its topics when it connects, its statistics when it asks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rt_robot_os.kernel import TaskStatistics


@dataclass(frozen=True)
class TopicInfo:
    """A topic of the core as a client sees it."""

    name: str
    channel: int
    type_name: str
    size: int
    max_size: int
    stamp_offset: int | None
    depth: int
    rate_hz: float


@dataclass(frozen=True)
class CoreStatistics:
    """
    What a core says of itself, as :meth:`LinkClient.statistics` gives it.

    :ivar resources: what tasks share, each as in ``kernel.ResourceStatistics``.
    """

    core: dict[str, Any]
    tasks: tuple[TaskStatistics, ...]
    topics: tuple[dict[str, Any], ...]
    devices: tuple[dict[str, Any], ...]
    clients: tuple[dict[str, Any], ...]
    resources: tuple[dict[str, Any], ...] = ()
    modules: tuple[dict[str, Any], ...] = ()
