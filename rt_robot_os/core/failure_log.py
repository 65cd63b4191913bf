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


"""Log failed jobs, with a back-off when a task fails repeatedly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import re

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.kernel import FailureReport
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import TaskAborted

FIRST_PAUSE_NS = NS_PER_S
LONGEST_PAUSE_NS = 60 * NS_PER_S
_KINDS_MAXIMUM = 64


@dataclass
class _Kind:
    """Failures from the same lines: logged once, then summarised with a back-off."""

    count: int
    since_ns: int
    pause_ns: int
    last: FailureReport


class FailureLog:
    """
    Log the failures of a kernel, in the lowest task.

    The first failure of a kind (the same task, from the same lines) is logged completely. Further
    ones are counted, and summarised in one line after a second, two, four, up to a minute. A kind
    that did not occur for such a pause is logged completely again.

    :param log: called with the task and the text.
    :param each: called with each failure.
    """

    def __init__(self, kernel: Kernel, log: Callable[[str, str], object],
                 each: Callable[[FailureReport], object]) -> None:
        self._kernel = kernel
        self._log = log
        self._each = each
        self._seen = 0
        self._kinds: dict[tuple[str, object], _Kind] = {}

    def watch(self) -> None:
        """Log new failures; call it a few times a second."""
        kernel = self._kernel
        total = kernel.failures_total
        kept = list(kernel.failures)
        new = min(total - self._seen, len(kept))
        lost = total - self._seen - new
        self._seen = total
        now_ns = kernel.now_ns()
        if lost > 0:
            self._log('core', f'{lost} failures came too fast to be logged; /diagnostics counts '
                      'them by task')
        for failure in kept[len(kept) - new:]:
            self._note(failure, now_ns)
        for key, kind in list(self._kinds.items()):
            if now_ns - kind.since_ns >= kind.pause_ns:
                self._sum_up(key, kind, now_ns)

    def _note(self, failure: FailureReport, now_ns: int) -> None:
        self._each(failure)
        key = _kind_of(failure)
        kind = self._kinds.get(key)
        if kind is not None:
            kind.count += 1
            kind.last = failure
            return
        if len(self._kinds) >= _KINDS_MAXIMUM:
            self._kinds.clear()  # bounded: a kind may be logged completely twice
        self._kinds[key] = _Kind(0, now_ns, FIRST_PAUSE_NS, failure)
        self._log(failure.task, str(failure))

    def _sum_up(self, key: tuple[str, object], kind: _Kind, now_ns: int) -> None:
        if not kind.count:
            del self._kinds[key]
            return
        seconds = (now_ns - kind.since_ns) / NS_PER_S
        self._log(kind.last.task, f'the same {kind.count} more times in {seconds:.0f} s, the '
                  f'last: {kind.last.error}')
        kind.count, kind.since_ns = 0, now_ns
        kind.pause_ns = min(2 * kind.pause_ns, LONGEST_PAUSE_NS)


def _kind_of(failure: FailureReport) -> tuple[str, object]:
    # An abort may hit any line; errors without a trace differ only in their numbers.
    if failure.trace and not failure.error.startswith(TaskAborted.__name__):
        return failure.task, failure.trace
    return failure.task, re.sub(r'\d+', '#', failure.error)
