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

"""
What is known of the machine and of both builds by single figures, and how these are named.

Cases name what they found; :mod:`rt_robot_os.tools.bench.expectations` makes sentences of it. All
times are in microseconds.
"""

from __future__ import annotations

# Floors: what the machine and the interpreter take without this package.
CALL = 'call of an empty Python function'
SYSTEM_CALL = 'system call from Python'
WAKE_CPU = 'CPU time of a bare wake-up'
WAKE_LATE, WAKE_LATE_P99 = 'bare wake-up, late', 'bare wake-up, late p99'
LOADED_LATE_P99 = 'bare wake-up beside a load, late p99'

# Of a kernel, whichever build it is.
LATE, LATE_P99 = 'idle kernel, late', 'idle kernel, late p99'
PREEMPTING_P99 = 'kernel that interrupts, late p99'

# Of each build.
TAKE = 'publish and take'
TO_TASK = 'publish to a task'
DELAY = 'delay of a message'
BARE_DELAY = 'publish and take after 2 ms of sleep'
TOGETHER = 'job released together with 99 others'
SPREAD = 'job of 100, each at its own moment'
ALONE = 'job that is alone'
REACHED, REACHED_SPREAD = '1000 tasks together, reached', '1000 tasks spread, reached'
OF_BUILDS = (TAKE, TO_TASK, DELAY, BARE_DELAY, TOGETHER, SPREAD, ALONE, REACHED, REACHED_SPREAD)
# Those by which two builds are compared, in words.
COMPARED = ((TO_TASK, 'a message to a task, one after the other,'), (DELAY, 'one at 500 Hz'),
            (TOGETHER, 'a job of 100 tasks released together'), (ALONE, 'a job that is alone'))


def of_build(name: str, build: str) -> str:
    """Name a figure of one build."""
    return f'{name} ({build})'
