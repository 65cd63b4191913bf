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


"""Find the tasks that used the CPU while a task waited for it: suspects of a missed deadline."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import islice
from typing import Any

from rt_robot_os.kernel.black_box import BLOCKED
from rt_robot_os.kernel.black_box import CEILING
from rt_robot_os.kernel.black_box import JOB
from rt_robot_os.kernel.task import Task

RECORDS_MAXIMUM = 64
SUSPECTS_MAXIMUM = 3


def blame(records: Iterable[tuple[Any, ...]], task: Task, release_ns: int, end_ns: int
          ) -> tuple[str, ...]:
    """
    Name the tasks that used the CPU most between the release and the end of a job.

    A job counts without the jobs that preempted it. Of a job that has not ended, and so has no
    record yet, the native calls and resources that blocked others count. At most
    ``RECORDS_MAXIMUM`` records are read, so older ones may be missing; that takes below 30 us.
    Safe in the real-time loop.

    :param records: of the black box, the most recent first (``black_box.latest(...)``).
    :param task: the task that was late; its own time is excluded.
    :return: at most ``SUSPECTS_MAXIMUM`` names, by CPU time, longest first.
    """
    used: dict[str, int] = {}
    # The jobs that enclose the current record, the innermost last. In the order of their ends, the
    # latest first, every job comes before those that preempted it.
    enclosing: list[tuple[int, Task]] = []
    for record in islice(records, RECORDS_MAXIMUM):
        kind = record[0]
        if kind == JOB:
            _, who, _, first_ns, last_ns, _ = record
        elif kind == BLOCKED:
            _, who, last_ns, late_ns = record
            first_ns = last_ns - late_ns
        elif kind == CEILING:
            _, who, first_ns, last_ns, _ = record
        else:
            continue
        if last_ns <= release_ns:
            break
        while enclosing and enclosing[-1][0] >= last_ns:
            enclosing.pop()
        own_ns = (last_ns if last_ns < end_ns else end_ns) - (
            first_ns if first_ns > release_ns else release_ns)
        if enclosing:
            outer_ns, outer = enclosing[-1]
            if outer is who:
                continue  # a part of a job that is counted as a whole
            if own_ns > 0:
                # The delay by a native call may have begun before its job.
                used[outer.name] -= own_ns if first_ns >= outer_ns else last_ns - outer_ns
        enclosing.append((first_ns, who))
        name = who.name
        used[name] = used.get(name, 0) + (own_ns if own_ns > 0 else 0)
    used.pop(task.name, None)
    suspects = [(-used_ns, name) for name, used_ns in used.items() if used_ns > 0]
    suspects.sort()
    return tuple([name for _, name in suspects[:SUSPECTS_MAXIMUM]])
