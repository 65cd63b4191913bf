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


"""One row for each thing that `top` shows: plain values, as ``--json`` prints them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Row:
    """
    What all rows have.

    :ivar new: counters that grew in the interval, with how much.
    """

    name: str
    new: dict[str, int]


@dataclass(frozen=True)
class TaskRow(Row):
    """
    A task.

    Rates, CPU and percentiles are those of the interval, None when there is nothing to take them
    from; maxima and counters are those since the start or the last reset.

    :ivar blocked_us: longest native call of this task that held up an interrupt.
    :ivar last_late_us: how late its latest job was that missed the deadline.
    :ivar ran_instead: which tasks ran instead then.
    """

    priority: int
    state: str
    rate_hz: float | None
    declared_hz: float
    latency_p50_us: float | None
    latency_p99_us: float | None
    latency_max_us: float
    execution_p50_us: float | None
    execution_p99_us: float | None
    execution_max_us: float
    cpu_percent: float | None
    runs: int
    missed: int
    deadline_missed: int
    overruns: int
    aborted: int
    failures: int
    budget_exceeded: int
    blocked_us: float
    last_late_us: float | None
    ran_instead: tuple[str, ...]


@dataclass(frozen=True)
class TopicRow(Row):
    """
    A topic.

    :ivar age_s: of the data in its last sample; None before the first.
    :ivar subscribers: of each its name, and how many samples it read, lost and skipped.
    :ivar lost: by all of them together.
    """

    type_name: str
    rate_hz: float | None
    declared_hz: float
    age_s: float | None
    depth: int
    slot_bytes: int
    published: int
    lost: int
    subscribers: tuple[dict[str, Any], ...]


@dataclass(frozen=True)
class DeviceRow(Row):
    """
    A device.

    :ivar rate_hz: samples a second.
    :ivar age_s: of its last valid frame; None before the first.
    """

    state: str
    rate_hz: float | None
    age_s: float | None
    faults: int
    opened: int
    lost_samples: int
    rejected_bytes: int
    rejected_frames: int
    reason: str


@dataclass(frozen=True)
class ClientRow(Row):
    """
    A client of the core, all of its mirrors together.

    :ivar rate_hz: samples that it was sent a second.
    :ivar full: samples that its full socket refused.
    :ivar lost: samples overwritten before they could be sent.
    :ivar limited: samples passed over by ``max_rate_hz``.
    :ivar skipped: samples passed over by ``latest``.
    :ivar dropped: replies and reports that it was too slow for.
    :ivar refused: samples of it that did not fit their topic.
    """

    pid: int
    rate_hz: float | None
    sent: int
    full: int
    lost: int
    limited: int
    skipped: int
    dropped: int
    received: int
    refused: int
    quiet_s: float
    mirrors: tuple[dict[str, Any], ...]


@dataclass(frozen=True)
class KernelRow(Row):
    """
    The core as a whole.

    :ivar cpu_percent: of one CPU, by the tasks; the kernel's own work is not in it.
    :ivar kernel_percent: of one CPU, by the kernel: releasing, dispatching, setting timers.
    :ivar process_cpu_percent: of one CPU, by the process, as Linux counts it.
    :ivar realtime: the real-time steps: step, ok, reason.
    :ivar stolen: times that Linux took the CPU from a job.
    :ivar simulated: devices that are.
    :ivar simulation_asked: the user requested it; False when there is no configuration.
    """

    pid: int
    uptime_s: float
    cpu_percent: float | None
    process_cpu_percent: float | None
    memory_mb: float | None
    wakeups_hz: float | None
    failures: int
    clients_refused: int
    watchdog: str
    black_box: dict[str, int]
    realtime: tuple[dict[str, Any], ...]
    simulated: tuple[str, ...]
    simulation_asked: bool
    stolen: int = 0
    stolen_maximum_us: float = 0.0
    kernel_percent: float | None = None


@dataclass(frozen=True)
class Snapshot:
    """
    Everything at one moment.

    :ivar at: time of day, ISO 8601.
    :ivar interval_s: that rates were taken over; None for the first sample of a core.
    """

    robot: str
    at: str
    interval_s: float | None
    kernel: KernelRow
    tasks: tuple[TaskRow, ...]
    topics: tuple[TopicRow, ...]
    devices: tuple[DeviceRow, ...]
    clients: tuple[ClientRow, ...]
