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


"""The public API of the kernel; everything above is built on these names only."""

from rt_robot_os.kernel.black_box import BlackBox
from rt_robot_os.kernel.black_box import BlackBoxDump
from rt_robot_os.kernel.black_box import TaskFacts
from rt_robot_os.kernel.clock import Clock
from rt_robot_os.kernel.clock import NEVER_NS
from rt_robot_os.kernel.cooperative_clock import CooperativeClock
from rt_robot_os.kernel.coroutine import any_of
from rt_robot_os.kernel.coroutine import Event
from rt_robot_os.kernel.coroutine import Ticks
from rt_robot_os.kernel.coroutine import Until
from rt_robot_os.kernel.coroutine import Wait
from rt_robot_os.kernel.failure import FailureReport
from rt_robot_os.kernel.failure import TaskAborted
from rt_robot_os.kernel.histogram import bucket
from rt_robot_os.kernel.histogram import bucket_limits
from rt_robot_os.kernel.histogram import BUCKETS
from rt_robot_os.kernel.histogram import Histogram
from rt_robot_os.kernel.histogram import summarise
from rt_robot_os.kernel.histogram import Summary
from rt_robot_os.kernel.kernel import Kernel
from rt_robot_os.kernel.monotonic_clock import MonotonicClock
from rt_robot_os.kernel.one_shot import OneShot
from rt_robot_os.kernel.resource import Resource
from rt_robot_os.kernel.spec import BudgetPolicy
from rt_robot_os.kernel.spec import FailurePolicy
from rt_robot_os.kernel.spec import OverrunPolicy
from rt_robot_os.kernel.spec import TaskSpec
from rt_robot_os.kernel.spec import TaskState
from rt_robot_os.kernel.statistics import DeadlineMiss
from rt_robot_os.kernel.statistics import KernelStatistics
from rt_robot_os.kernel.statistics import ResourceStatistics
from rt_robot_os.kernel.statistics import SourceStatistics
from rt_robot_os.kernel.statistics import TaskStatistics
from rt_robot_os.kernel.task import Task
from rt_robot_os.kernel.trace import TraceEvent
from rt_robot_os.kernel.trace import TraceLog
from rt_robot_os.kernel.virtual_clock import VirtualClock

__all__ = [
    'any_of', 'BlackBox', 'BlackBoxDump', 'bucket', 'bucket_limits', 'BUCKETS', 'BudgetPolicy',
    'Clock', 'CooperativeClock', 'DeadlineMiss', 'Event', 'FailurePolicy', 'FailureReport',
    'Histogram', 'Kernel', 'KernelStatistics', 'MonotonicClock', 'NEVER_NS', 'OneShot',
    'OverrunPolicy', 'Resource', 'ResourceStatistics', 'SourceStatistics', 'summarise',
    'Summary', 'Task', 'TaskAborted', 'TaskFacts', 'TaskSpec', 'TaskState', 'TaskStatistics',
    'Ticks', 'TraceEvent', 'TraceLog', 'Until', 'VirtualClock', 'Wait',
]
