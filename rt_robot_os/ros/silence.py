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

"""For how long a core has given no sign of life, and what that means."""

from __future__ import annotations

from collections.abc import Callable
import time

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.link.sign_of_life import Signs
from rt_robot_os.linux.process import scheduling_state

DEAD_AFTER_BEATS = 3
# What a step takes beyond this is time in which this process itself was stopped or held up.
_STEP_MAXIMUM_S = 0.25
# With less than this share of a CPU a core was starved: one that computes takes all it can get.
_SHARE = 0.1


class Silence:
    """
    Count the time without a new sign, in time in which this process itself was running.

    :ivar silent_s: since the last new sign.
    """

    def __init__(self, monotonic_s: Callable[[], float] = time.monotonic) -> None:
        self.silent_s = 0.0
        self._monotonic_s = monotonic_s
        self._sign: object = None
        self._looked_s = monotonic_s()

    def look(self, sign: object, step_maximum_s: float = _STEP_MAXIMUM_S) -> float:
        """
        Note a sign, after everything that has arrived was read.

        :param sign: what changes as long as the core lives.
        :param step_maximum_s: what passed since the last call counts up to this.
        :return: for how long it has not changed.
        """
        now_s = self._monotonic_s()
        step_s = min(now_s - self._looked_s, step_maximum_s)
        self._looked_s = now_s
        if sign != self._sign:
            self._sign = sign
            self.silent_s = 0.0
        else:
            self.silent_s += step_s
        return self.silent_s

    def restart(self) -> None:
        """Begin anew, with another core or another connection."""
        self.silent_s = 0.0
        self._looked_s = self._monotonic_s()


class Starvation:
    """
    Distinguish a silent core that Linux does not let run from one that hangs.

    To kill the first would not help: what has its CPU, a program of the same or a higher real-time
    priority, would starve the next one as well. One that hangs computes, or waits for something.

    :param look: returns whether a process is ready to run, and its computing time in ns.
    """

    def __init__(self, look: Callable[[int], tuple[bool, int]] = scheduling_state) -> None:
        self._look = look
        self._since: tuple[float, int] | None = None

    def look(self, pid: int, silent_s: float) -> bool:
        """
        Compare what a core computed with how long it has been silent.

        :param silent_s: 0 when it is not.
        :return: whether it is ready to run and was let run for less than a tenth of the time.
        """
        if not silent_s or not pid:
            self._since = None
            return False
        ready, computed_ns = self._look(pid)
        if self._since is None:
            self._since = silent_s, computed_ns
        since_s, since_ns = self._since
        waited_s = silent_s - since_s
        return ready and computed_ns - since_ns < _SHARE * waited_s * NS_PER_S


def trouble(signs: Signs | None, silent_s: float, starved: bool, heartbeat_s: float
            ) -> tuple[str, str]:
    """
    Return what is the matter with a core that is connected.

    :param signs: what its sign of life says; None without one.
    :param starved: Linux does not let it run.
    :return: the kind of trouble, each of which is logged once, and its text; '' without any.
    """
    if silent_s > DEAD_AFTER_BEATS * heartbeat_s and starved:
        return 'kept off', (
            f'Linux has not let the core run for {silent_s:.1f} s: another program of the '
            'same or a higher real-time priority has its CPU (see `doctor`)')
    if silent_s > heartbeat_s:
        return 'silent', f'no sign of life of the core for {silent_s:.1f} s'
    if signs is None:
        return '', ''
    waits_s = (signs.at_ns - signs.served_ns) / NS_PER_S
    if waits_s <= heartbeat_s:
        return '', ''
    runs = f'task {signs.task!r} runs' if signs.task else 'other tasks run'
    return 'busy', (f'the core is alive, but its link has not come to run for {waits_s:.1f} '
                    f's: {runs}')
