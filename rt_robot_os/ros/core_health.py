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

"""Supervise the liveness of a core: unresponsive, starved, or busy."""

from __future__ import annotations

from collections.abc import Callable
import time

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.link.liveness import Liveness
from rt_robot_os.linux.process import scheduling_state

DEAD_AFTER_BEATS = 3
# A longer step is time in which this process itself was stopped or delayed.
_STEP_MAXIMUM_S = 0.25
# With less than this share of a CPU a core was starved: a busy core uses all it can get.
_SHARE = 0.1


class SilenceTimer:
    """
    Count the time without a change of the liveness counter, while this process itself runs.

    :ivar silent_s: since the last change.
    """

    def __init__(self, monotonic_s: Callable[[], float] = time.monotonic) -> None:
        self.silent_s = 0.0
        self._monotonic_s = monotonic_s
        self._counter: object = None
        self._updated_s = monotonic_s()

    def update(self, counter: object, step_maximum_s: float = _STEP_MAXIMUM_S) -> float:
        """
        Compare the counter with the last one; call it when everything that arrived is read.

        :param counter: a value that changes while the core is alive.
        :param step_maximum_s: the time since the last call counts at most this much.
        :return: how long the counter has not changed.
        """
        now_s = self._monotonic_s()
        step_s = min(now_s - self._updated_s, step_maximum_s)
        self._updated_s = now_s
        if counter != self._counter:
            self._counter = counter
            self.silent_s = 0.0
        else:
            self.silent_s += step_s
        return self.silent_s

    def restart(self) -> None:
        """Restart, for another core or another connection."""
        self.silent_s = 0.0
        self._updated_s = self._monotonic_s()


class StarvationDetector:
    """
    Distinguish an unresponsive core that Linux does not let run from a core that hangs.

    Killing a starved core would not help: the program that uses its CPU, with the same or a higher
    real-time priority, would starve the next core as well. A core that hangs computes, or waits.

    :param usage: returns whether a process is ready to run, and its computing time in ns.
    """

    def __init__(self, usage: Callable[[int], tuple[bool, int]] = scheduling_state) -> None:
        self._usage = usage
        self._since: tuple[float, int] | None = None

    def update(self, pid: int, silent_s: float) -> bool:
        """
        Compare the computing time of a core with the time for which it has been unresponsive.

        :param silent_s: 0 when it responds.
        :return: whether it is ready to run but has run for less than a tenth of the time.
        """
        if not silent_s or not pid:
            self._since = None
            return False
        ready, computed_ns = self._usage(pid)
        if self._since is None:
            self._since = silent_s, computed_ns
        since_s, since_ns = self._since
        waited_s = silent_s - since_s
        return ready and computed_ns - since_ns < _SHARE * waited_s * NS_PER_S


def connection_problem(liveness: Liveness | None, silent_s: float, starved: bool,
                       heartbeat_s: float) -> tuple[str, str]:
    """
    Return the problem of a core that is connected.

    :param liveness: its liveness counter; None without one.
    :param starved: Linux does not let it run.
    :return: the kind of problem, each of which is logged once, and its text; '' for none.
    """
    if silent_s > DEAD_AFTER_BEATS * heartbeat_s and starved:
        return 'kept off', (
            f'Linux has not let the core run for {silent_s:.1f} s: another program of the '
            'same or a higher real-time priority uses its CPU (see `doctor`)')
    if silent_s > heartbeat_s:
        return 'silent', f'the liveness counter of the core has stopped for {silent_s:.1f} s'
    if liveness is None:
        return '', ''
    waits_s = (liveness.at_ns - liveness.served_ns) / NS_PER_S
    if waits_s <= heartbeat_s:
        return '', ''
    runs = f'task {liveness.task!r} runs' if liveness.task else 'other tasks run'
    return 'busy', (f'the core is alive, but its link has been starved for {waits_s:.1f} '
                    f's: {runs}')
