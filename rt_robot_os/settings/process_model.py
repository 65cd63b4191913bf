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

"""The settings of the process that runs the kernel: its sections with fixed names."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rt_robot_os.base.schema import setting
from rt_robot_os.base.units import NS_PER_US
from rt_robot_os.kernel.black_box import RECORDS_DEFAULT
from rt_robot_os.kernel.kernel import SPIN_MAXIMUM_NS
from rt_robot_os.kernel.spec import PRIORITY_MAXIMUM
from rt_robot_os.kernel.spec import PRIORITY_MINIMUM
from rt_robot_os.link.server import COMMAND_PRIORITY
from rt_robot_os.link.server import SERVICE_PRIORITY


def priority_setting(default: int, description: str) -> Any:
    """Declare a priority in the kernel."""
    return setting(default, description, minimum=PRIORITY_MINIMUM, maximum=PRIORITY_MAXIMUM)


@dataclass(frozen=True, slots=True)
class CoreSettings:
    """The process that runs the kernel."""

    spawn: bool = setting(True, 'start the core as a child; false: attach to a running core')
    cpu: int = setting(
        -1, 'CPU it is pinned to; -1: the allowed CPU with the fewest robots, of several the '
        'last; -2: not pinned', minimum=-2, maximum=1023)
    scheduler_priority: int = setting(
        80, 'SCHED_FIFO priority; 0: an ordinary process', minimum=0, maximum=99)
    lock_memory: bool = setting(True, 'keep all memory resident')
    heartbeat_s: float = setting(
        1.0, 'time without a change of the liveness counter after which the core is reported; '
        'after three times this the node restarts a core that it has started', 's', 0.1, 60.0)
    link_priority: int = priority_setting(
        SERVICE_PRIORITY, 'kernel priority of the task that serves clients: below all important '
        'tasks')
    link_gather_ms: float = setting(
        5.0, 'samples that are mirrored within this time after others are sent together, which '
        'costs the core less per sample; 0: each immediately', 'ms', 0.0, 1000.0)
    command_priority: int = priority_setting(
        COMMAND_PRIORITY, 'kernel priority at which samples from ROS are published')
    spin_us: float = setting(
        0.0, 'wake this much early and spin up to the release: less jitter for computing time; '
        '0: sleep', 'us', 0.0, SPIN_MAXIMUM_NS / NS_PER_US)
    cpu_latency_us: int = setting(
        -1, 'longest time a sleeping CPU may take to wake, requested at /dev/cpu_dma_latency; '
        '-1: no request', 'us', -1, 1_000_000)
    dispatcher: str = setting(
        'preemptive', 'preemptive: a higher priority interrupts a lower one; cooperative: it '
        'waits for the end of the job', choices=('preemptive', 'cooperative'))
    black_box_records: int = setting(
        RECORDS_DEFAULT, 'number of records in the black box', 'records', 64, 1 << 20)
    black_box_folder: str = setting(
        '', 'folder of the dumps of the black box; when absent $ROS_LOG_DIR or ~/.ros/log')
    record_bytes: bool = setting(
        False, 'tap bytes of devices and times of jobs from the start, so that a recording is '
        'complete and its replay exact')


@dataclass(frozen=True, slots=True)
class WatchdogSettings:
    """The reaction to an unhealthy critical task."""

    timeout_s: float = setting(
        0.0, 'how long a critical task may be unhealthy; 0: no watchdog', 's', 0.0, 3600.0)
    action: str = setting(
        'log', 'reaction: log it; safe_state: bring every task with a safe state there and hold '
        'it; exit: end the core', choices=('log', 'safe_state', 'exit'))
    exit_code: int = setting(70, 'exit code of the core after exit', minimum=3, maximum=125)
    device: str = setting(
        '', 'a hardware watchdog that is also fed, such as /dev/watchdog')


@dataclass(frozen=True, slots=True)
class LogSettings:
    """The log file, which the node writes."""

    file: bool = setting(True, "the node writes the core's log to a file")
    folder: str = setting('', 'folder of the log file; when absent $ROS_LOG_DIR or ~/.ros/log')
    file_mb: float = setting(10.0, 'size at which a new file is started', 'MB', 0.001, 10_000.0)
    files: int = setting(
        5, 'number of files that are kept, including the newest', minimum=1, maximum=1000)
