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

"""The statistics of a core, as its clients receive them."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field
from types import MappingProxyType
from typing import Any
from typing import Final
from typing import TYPE_CHECKING

from rt_robot_os.base.errors import LinkError
from rt_robot_os.link.protocol import decode_json
from rt_robot_os.link.protocol import Header
from rt_robot_os.link.protocol import HEADER_BYTES
from rt_robot_os.link.protocol import PacketKind

if TYPE_CHECKING:
    from rt_robot_os.kernel import TaskStatistics
    from rt_robot_os.link.task_records import TaskCounts

#: Why devices are simulated although the user did not ask for it (``simulation_asked`` is False).
SHIPPED_IN_USE: Final = 'the shipped robot.yaml is in use'


@dataclass(frozen=True)
class CoreStatistics:
    """
    The statistics of a core, as :meth:`LinkClient.statistics` returns them.

    :ivar resources: shared by tasks, each as in ``kernel.ResourceStatistics``.
    :ivar counts: the histograms by task name, to be subtracted from later ones.
    """

    core: dict[str, Any]
    tasks: tuple[TaskStatistics, ...]
    topics: tuple[dict[str, Any], ...]
    devices: tuple[dict[str, Any], ...]
    clients: tuple[dict[str, Any], ...]
    resources: tuple[dict[str, Any], ...] = ()
    modules: tuple[dict[str, Any], ...] = ()
    # A read-only mapping has no hash before Python 3.12, so it is no default by itself.
    counts: Mapping[str, TaskCounts] = field(default_factory=lambda: MappingProxyType({}))


def collect(packets: Iterable[tuple[Header, bytes]]) -> CoreStatistics:
    """
    Combine the packets of an answer to ``statistics``.

    :raises LinkError: a packet is not valid, or the core refuses; the message gives its reason.
    """
    # Late: most clients do not request statistics.
    from rt_robot_os.link.task_records import decode_counts
    from rt_robot_os.link.task_records import decode_task
    tasks: list[TaskStatistics] = []
    counts: dict[str, TaskCounts] = {}
    parts: dict[str, list[dict[str, Any]]] = {
        'core': [], 'topic': [], 'device': [], 'client': [], 'resource': [], 'module': []}
    for head, packet in packets:
        if head.kind == PacketKind.TASK:
            record = memoryview(packet)[HEADER_BYTES:]
            tasks.append(decode_task(record))
            counts[tasks[-1].name] = decode_counts(record)
            continue
        content = decode_json(packet)
        if 'error' in content:
            raise LinkError(str(content['error']))
        part = content.pop('part', None)
        if part in parts:
            parts[part].append(content)
    core = parts['core'][0] if parts['core'] else {}
    return CoreStatistics(core, tuple(tasks), tuple(parts['topic']), tuple(parts['device']),
                          tuple(parts['client']), tuple(parts['resource']),
                          tuple(parts['module']), counts)
