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


"""The settings of the robot itself; drivers, simulators and modules bring their own."""

from __future__ import annotations

from typing import Final

from rt_robot_os.logger import LEVELS
from rt_robot_os.schema import Field
from rt_robot_os.schema import REQUIRED

SLOWEST_HZ: Final = 0.1
FASTEST_HZ: Final = 10_000.0

LONGEST_US: Final = 1e9  # a period, a deadline, a budget

LISTS: Final = ('devices', 'modules', 'topics', 'mirrors')

# Parameters that ROS 2 itself gives a node; a dumped file contains them.
ROS_OWN: Final = frozenset({'use_sim_time', 'start_type_description_service', 'qos_overrides'})


def _priority(default: int, description: str) -> Field:
    return Field('priority', int, default, description, minimum=1, maximum=99)


def _rate(default: float, description: str) -> Field:
    return Field('rate_hz', float, default, description, 'Hz', SLOWEST_HZ, FASTEST_HZ, live=True)


ROBOT: Final = (
    Field('autostart', bool, True, 'the node configures and activates itself'),
    Field('diagnostics_rate_hz', float, 1.0, 'how often /diagnostics is published',
          'Hz', SLOWEST_HZ, 100.0),
    Field('parameters_file', str, '', 'where ~/save_parameters writes what was changed; when '
          'absent the name of the robot and .saved.yaml, in $ROS_HOME or ~/.ros'),
    Field('devices', list, (), 'names of the devices, each with a section of that name'),
    Field('modules', list, (), 'names of the modules, each with a section of that name'),
    Field('topics', list, (), 'names of further core topics, each with a section of that name'),
    Field('mirrors', list, (), 'names of the mirrors to ROS, each with a section of that name'),
)

CORE: Final = (
    Field('spawn', bool, True, 'start the core as a child; false: attach to one that runs'),
    Field('cpu', int, -1, 'CPU it is pinned to; -1: of those allowed the one with the fewest '
          'robots, of these the last; -2: not pinned',
          minimum=-2, maximum=1023),
    Field('scheduler_priority', int, 80, 'SCHED_FIFO priority; 0: stay an ordinary process',
          minimum=0, maximum=99),
    Field('lock_memory', bool, True, 'keep all memory resident'),
    Field('heartbeat_s', float, 1.0, 'time without a sign of life after which the core '
          'is reported; after three times that one that the node has started is started anew',
          's', 0.1, 60.0),
    Field('link_priority', int, 2, 'kernel priority of what serves clients: below what matters',
          minimum=1, maximum=99),
    Field('link_gather_ms', float, 5.0, 'samples that are mirrored within this time of those '
          'before go out together: the core spends less on each; 0: each at once', 'ms',
          0.0, 1000.0),
    Field('command_priority', int, 50, 'kernel priority at which samples from ROS are published',
          minimum=1, maximum=99),
    Field('spin_us', float, 0.0, 'wake this much early and spin up to the release: less jitter '
          'for computing time; 0: sleep', 'us', 0.0, 1000.0),
    Field('cpu_latency_us', int, -1, 'longest time a sleeping CPU may take to wake, as asked of '
          '/dev/cpu_dma_latency; -1: leave it', 'us', -1, 1_000_000),
    Field('dispatcher', str, 'preemptive', 'preemptive: the higher priority interrupts the lower; '
          'cooperative: it waits for the end of the job', choices=('preemptive', 'cooperative')),
    Field('black_box_records', int, 2048, 'records the black box keeps', 'records', 64, 1 << 20),
    Field('black_box_folder', str, '', 'where the black box is written after a fault; when absent '
          '$ROS_LOG_DIR or ~/.ros/log'),
    Field('record_bytes', bool, False, 'tap bytes of devices and times of jobs from the start, so '
          'that record gets all of them and replay is exact'),
)

WATCHDOG: Final = (
    Field('timeout_s', float, 0.0, 'how long a critical task may be unhealthy; 0: no watchdog',
          's', 0.0, 3600.0),
    Field('action', str, 'log', 'what comes then: log it, bring every task with a safe state '
          'there and hold it, or exit', choices=('log', 'safe_state', 'exit')),
    Field('exit_code', int, 70, 'exit code of the core after exit', minimum=3, maximum=125),
    Field('device', str, '', 'a watchdog of the machine that is fed as well, such as '
          '/dev/watchdog'),
)

LOG: Final = (
    Field('file', bool, True, "the node writes the core's log to a file"),
    Field('folder', str, '', 'where it lies; when absent $ROS_LOG_DIR or ~/.ros/log'),
    Field('file_mb', float, 10.0, 'size at which a new file is begun', 'MB', 0.001, 10_000.0),
    Field('files', int, 5, 'files that are kept, the newest included', minimum=1, maximum=1000),
)

# What a device and a module declare of their task, besides its rate and its priority.
SUBSCRIBERS_MAXIMUM: Final = 4096

_MAX_SUBSCRIBERS: Final = Field(
    'max_subscribers', int, 64, 'most modules that may read one of its topics (of several '
    'sections that publish it the largest number counts); mirrors and recordings do not count',
    minimum=1, maximum=SUBSCRIBERS_MAXIMUM)

TASK: Final = (
    Field('phase_us', float, 0.0, 'first release after the start', 'us', 0.0, LONGEST_US),
    Field('deadline_us', float, 0.0, 'time from a release to the latest end of its job; 0: the '
          'period, without a rate none', 'us', 0.0, LONGEST_US),
    Field('budget_us', float, 0.0, 'computing time a job may use, what preempts it not counted; '
          '0: any', 'us', 0.0, LONGEST_US),
    Field('on_budget', str, 'warn', 'what happens to a job that uses more: count it, or abort it',
          choices=('warn', 'abort')),
    Field('overrun', str, 'skip', 'what happens to a release that finds the job before unfinished',
          choices=('skip', 'rephase', 'catch_up', 'stop')),
    Field('catch_up', int, 1, 'most releases made up for, with overrun: catch_up',
          minimum=1, maximum=1000),
    Field('overrun_limit', int, 0, 'overruns after which the failure policy is applied; 0: never',
          minimum=0, maximum=1_000_000),
    Field('overrun_leak', int, 100, 'jobs without overrun that take one overrun away',
          minimum=1, maximum=1_000_000),
    Field('failure', str, 'continue', 'what follows an exception, an abort or too many overruns',
          choices=('continue', 'restart', 'stop', 'safe_state')),
    Field('restart_s', float, 0.1, 'wait before the first restart; doubled with each', 's',
          0.001, 3600.0),
    Field('restart_max_s', float, 10.0, 'longest wait before a restart', 's', 0.001, 3600.0),
    Field('critical', bool, False, 'the watchdog watches it'),
    Field('resources', list, (), 'names of what it may lock; tasks that name the same share it'),
    Field('logical_execution', bool, False, 'inputs are those of the release, outputs are '
          'published at the deadline'),
    Field('execution_us', float, 0.0, 'longest computing time of a job as you know it, for plan; '
          '0: unknown', 'us', 0.0, LONGEST_US),
)

_LOG_LEVEL: Final = Field(
    'log_level', str, 'info', 'the least severity that it logs', choices=LEVELS, live=True)

_ENABLED: Final = Field(
    'enabled', bool, True, 'false: it is left out, and its topics are silent')

DEVICE: Final = (
    Field('type', str, REQUIRED, "the driver's name"),
    _ENABLED,
    _rate(100.0, 'how often the device is polled'),
    _priority(60, 'priority of its task; higher runs first'),
    Field('read', str, 'poll', 'when it is read: poll at rate_hz; interrupt as bytes arrive too '
          '(a device on I2C always, but with logical_execution)',
          choices=('poll', 'interrupt')),
    Field('timeout_s', float, 1.0, 'silence after which the device counts as faulty',
          's', 0.01, 3600.0),
    Field('retry_s', float, 0.5, 'wait before it is opened again; doubles with each failure',
          's', 0.01, 3600.0),
    Field('retry_max_s', float, 10.0, 'longest wait between two tries', 's', 0.01, 3600.0),
    _MAX_SUBSCRIBERS,
    _LOG_LEVEL,
    *TASK,
)

MODULE: Final = (
    Field('type', str, REQUIRED, "the module's name, or package.module:Class"),
    _ENABLED,
    Field('rate_hz', float, 50.0, 'how often the module steps; 0: only when an input wakes it',
          'Hz', 0.0, FASTEST_HZ, live=True),
    _priority(40, 'priority of its task; higher runs first'),
    _MAX_SUBSCRIBERS,
    _LOG_LEVEL,
    *TASK,
)

TOPIC: Final = (
    Field('topic', str, '', 'its name in the core; the name of the section when absent'),
    Field('message', str, REQUIRED, 'its type, such as geometry_msgs/msg/Twist'),
    Field('depth', int, 8, 'slots in the ring; a power of two', minimum=1, maximum=65536),
    Field('rate_hz', float, 0.0, 'rate expected; 0: unknown', 'Hz', 0.0, FASTEST_HZ),
    Field('tail', int, 0, 'most bytes of the one sequence of variable length; 0: there is none',
          'bytes', 0, 64 * 1024 * 1024),
    _MAX_SUBSCRIBERS,
)

MIRROR: Final = (
    Field('topic', str, REQUIRED, 'the topic in the core'),
    Field('direction', str, 'out', 'where it goes: out to ROS or in from it',
          choices=('out', 'in')),
    Field('ros_topic', str, '', 'the topic in ROS; the same name when absent'),
    Field('policy', str, 'drain', 'what is handed on: drain every sample, latest the newest',
          choices=('drain', 'latest'), live=True),
    Field('max_rate_hz', float, 0.0, 'most samples a second; 0: no limit', 'Hz', 0.0, FASTEST_HZ,
          live=True),
    Field('reliability', str, 'auto', 'quality of service; auto: reliable outward, inward '
          'best_effort, which hears every publisher, and reliable with transient_local',
          choices=('auto', 'reliable', 'best_effort')),
    Field('durability', str, 'volatile', 'quality of service',
          choices=('volatile', 'transient_local')),
    Field('depth', int, 10, 'length of the ROS queue', 'samples', 1, 10_000),
    Field('stamped', bool, False, 'the ROS topic has the type with a header, such as TwistStamped '
          'where the core has Twist; inward its age counts as that of the sample'),
    Field('frame_id', str, '', 'in the header of what goes out, with stamped: true'),
)
