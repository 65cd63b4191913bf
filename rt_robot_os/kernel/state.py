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


"""What the kernel remembers, and the smallest steps on it; its other parts build on this."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

from rt_robot_os.kernel.black_box import BlackBox
from rt_robot_os.kernel.black_box import RECORDS_DEFAULT
from rt_robot_os.kernel.clock import Clock
from rt_robot_os.kernel.clock import NEVER_NS
from rt_robot_os.kernel.failure import FailureReport
from rt_robot_os.kernel.interrupts import InterruptSources
from rt_robot_os.kernel.policy import PRIORITY_MAXIMUM
from rt_robot_os.kernel.stolen import Stolen
from rt_robot_os.kernel.task import Task

IDLE_LEVEL = 0
# Above every task: what happens at a point in time rather than in a job.
LEVEL_END = PRIORITY_MAXIMUM + 3
LEVEL_OUTPUTS = PRIORITY_MAXIMUM + 2
LEVEL_INPUTS = PRIORITY_MAXIMUM + 1
LEVELS = LEVEL_END + 1
_FAILURES_KEPT = 32

TraceHook = Callable[[int, str, str], None]
# (time, order among equals, task or action, period in force until then; 0: it comes once)
Timer = tuple[int, int, Any, int]


class KernelState:
    """
    The data of a kernel.

    :ivar locked: set inside a critical section of the kernel or of a topic.
    :ivar pending: something came up meanwhile: call ``settle`` after clearing ``locked``.
    :ivar trace: called with (time, kind, task name) for each start and end, unless it is None.
    :ivar black_box: the last things that happened.
    :ivar record: ``black_box.add``.
    :ivar spin_ns: wake this much before a release and spin until it.
    :ivar stolen: time that Linux took from the jobs.
    :ivar stop_grace_ns: jobs that run so long after :meth:`stop` are ended; by default never.
    :ivar ended: the tasks whose jobs were, since the kernel was started.
    :ivar overhead_ns: what the kernel itself computed for: releasing, dispatching, setting alarms.

    Of what is not public:

    - ``_timers``, of each level: a heap of what falls due;
    - ``_queues``, of each level: tasks whose job waits, in the order of their releases;
    - ``_ready``: bits of the levels at which something waits, or may have fallen due;
    - ``_firsts``: a heap of (due, level) with the first timer of each level that has no bit there;
    - ``_watched_ns``, of each level: which entry of ``_firsts`` counts.
    """

    # Slots are the fastest attributes, and there are more than an inline dictionary holds.
    __slots__ = (
        'clock', 'now_ns', 'locked', 'pending', 'trace', 'running', 'failures_total',
        'failures', 'black_box', 'record', 'spin_ns', '_interrupts', '_interrupted',
        '_stopping', '_stop_reason',
        '_stop_ns', 'stop_grace_ns', 'ended', '_current', '_level', '_stolen_ns', '_armed_ns',
        '_armed_due_ns', '_spare_ns', '_ready', '_queues', '_bits', '_timers', '_firsts',
        '_watched_ns', 'overhead_ns', '_end_ns', '_recursion_limit', '_one_shots',
        '_resources', '_suspects_ns', 'stolen', '_ended')

    def __init__(self, clock: Clock, spin_ns: int = 0, records: int = RECORDS_DEFAULT) -> None:
        self.clock = clock
        self.now_ns = clock.now_ns
        self.spin_ns = spin_ns
        self.locked = False
        self.pending = False
        self.trace: TraceHook | None = None
        self.running = False
        self.failures_total = 0
        self.failures: deque[FailureReport] = deque(maxlen=_FAILURES_KEPT)
        self.black_box = BlackBox(records)
        self.record = self.black_box.add
        self._interrupts = InterruptSources(clock)
        self._interrupted = False
        self._stopping = False
        self._stop_reason = ''
        self._stop_ns = NEVER_NS
        self.stop_grace_ns = NEVER_NS
        self.ended: list[str] = []
        self._current: Task | None = None
        self._level = IDLE_LEVEL
        self._stolen_ns = 0
        self._armed_ns = 0
        self._armed_due_ns = 0  # the release that the alarm is for, if nothing else matters
        self._spare_ns = 0
        self._ready = 0
        self._queues: list[deque[Task]] = [deque() for _ in range(LEVELS)]
        self._bits = [1 << level for level in range(LEVELS)]
        self._timers: list[list[Timer]] = []
        self._firsts: list[tuple[int, int]] = []
        self._watched_ns: list[int] = []
        self.overhead_ns = 0
        self._end_ns = NEVER_NS
        self._recursion_limit = 0
        self._one_shots = 0
        self._suspects_ns = 0
        self.stolen = Stolen(clock)
        self._ended: tuple[Task | None, int, int] = (None, 0, 0)
        self._resources: dict[str, Any] = {}

    def _note_failure(self, failure: FailureReport) -> None:
        self.failures_total += 1
        self.failures.append(failure)
