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


"""A virtual clock whose calls take time, and which simulates steal time on request."""

from __future__ import annotations

from collections.abc import Callable

from differential_scenario import ClockData

from rt_robot_os.kernel import VirtualClock
from rt_robot_os.kernel.clock import Handler
from rt_robot_os.kernel.clock import TICK_SIGNAL

# Only a spinning kernel reads the clock this many times in a row.
SPINNING_READS = 100
SPINNING_STEP_NS = 1_000


class ScenarioClock(VirtualClock):
    """
    The clock of a scenario.

    :param spins: the kernel spins until a release, so that time must pass when the clock is read.
    :param note: called each time that a timer is set, or the kernel waits.
    :ivar reads: how often it was read since something else happened.
    """

    def __init__(self, data: ClockData, spins: bool, note: Callable[..., None]) -> None:
        super().__init__(data.start_ns)
        self.wake_ns = data.wake_ns
        self.reads = 0
        self._data = data
        self._spins = spins
        self._note = note
        self._lost_ns = self._queued_ns = 0
        self._on_interrupt: Handler = super().detach
        self._on_break: Handler = super().detach
        self.now_ns = self._count_read if spins else self._read
        self.computed_ns = self._computed

    @property
    def time_ns(self) -> int:
        """Return the time without counting that as a reading."""
        return self._now_ns

    def _count_read(self) -> int:
        self.reads += 1
        if self.reads > SPINNING_READS:
            self._now_ns += SPINNING_STEP_NS
        return self._now_ns

    def _computed(self) -> int:
        return self._now_ns - self._lost_ns

    def waited_ns(self) -> int:
        return self._queued_ns

    # ---- what the kernel asks ----------------------------------------------------------------

    def attach(self, on_tick: Handler, on_interrupt: Handler, on_break: Handler) -> None:
        def signalled() -> None:
            self._note('clock', 'signal')
            on_tick(TICK_SIGNAL, None)

        super().attach(signalled if self._data.signal else on_tick, on_interrupt, on_break)
        self._on_interrupt, self._on_break = on_interrupt, on_break

    def arm(self, deadline_ns: int) -> None:
        self.reads = 0
        self._note('clock', 'arm', deadline_ns)
        self._take_time(deadline_ns)
        super().arm(deadline_ns)

    def arm_spare(self, deadline_ns: int) -> None:
        self._note('clock', 'arm spare', deadline_ns)
        self._take_time(deadline_ns)
        super().arm_spare(deadline_ns)

    def _take_time(self, deadline_ns: int) -> None:
        # But what goes on then must get ahead, if by 1 ns, or this would go on for ever.
        self._now_ns += min(self._data.arm_ns, max(0, deadline_ns - self._now_ns - 1))

    def swap(self) -> None:
        self._note('clock', 'swap')
        super().swap()

    def wait_masked(self) -> bool:
        self.reads = 0
        self._note('clock', 'wait')
        came = super().wait_masked()
        self._now_ns += self._data.late_ns
        return came

    def poll(self, until_ns: int) -> int:
        self._note('clock', 'poll', until_ns)
        return super().poll(until_ns)

    # ---- what a job does ---------------------------------------------------------------------

    def spend(self, duration_ns: int) -> None:
        self.reads = 0
        super().spend(duration_ns)

    def _go_on(self) -> None:
        """Do the first thing after a native call: the timer's handler runs before, if due."""
        self.spend(1)

    def stall(self, duration_ns: int) -> None:
        """Make a native call, which nothing preempts."""
        self._now_ns += duration_ns
        self._go_on()

    def steal(self, duration_ns: int) -> None:
        """Let another program have the CPU."""
        self._now_ns += duration_ns
        self._lost_ns += duration_ns
        self._queued_ns += duration_ns
        self._go_on()

    def stop_process(self, duration_ns: int) -> None:
        """Stop the process (SIGSTOP) for a time."""
        self._now_ns += duration_ns
        self._lost_ns += duration_ns
        self.was_stopped = True
        self._go_on()

    def interrupt(self) -> None:
        """Let the handler of interrupts run."""
        self._on_interrupt()

    def press_break(self) -> None:
        """Press Ctrl-C."""
        self._on_break()
