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
Time as the kernel sees it: now, two timers that interrupt, and waiting.

The kernel does not depend on the kind of clock. With
:class:`~rt_robot_os.kernel.MonotonicClock` a timer is a signal that interrupts the running Python
code. With :class:`~rt_robot_os.kernel.VirtualClock` time passes only where a task simulates work
(:meth:`Clock.spend`), and the interrupt is a plain call. Both call the same handler.
"""

from __future__ import annotations

from abc import ABC
from abc import abstractmethod
from collections.abc import Callable
from collections.abc import Iterable
from importlib import import_module
import signal
import time
from typing import Any
from typing import ClassVar
from typing import Final
from typing import NamedTuple
import warnings

from rt_robot_os.linux.timer import HasPending

# Later than any time; sums with it still fit 64 bits.
NEVER_NS: Final = 1 << 61

TICK_SIGNAL = signal.SIGRTMIN + 5
INTERRUPT_SIGNAL = signal.SIGRTMIN + 6

Handler = Callable[..., None]


def signal_name(signo: int) -> str:
    """Return the name of a signal; real-time signals have a number only."""
    try:
        return signal.Signals(signo).name
    except ValueError:
        return f'signal {signo}'


class PosixTimers(NamedTuple):
    """
    The timers of a clock and the signals that end its waits, as Linux identifies them.

    :ivar first: id of the timer for ``timer_settime``; ``second`` is that of the spare timer.
    :ivar repeat_ns: interval at which they repeat.
    :ivar mask: the signals that end a wait: bit n-1 stands for signal n.
    :ivar tick_signal: the signal of the timers.
    """

    first: int
    second: int
    repeat_ns: int
    mask: int
    tick_signal: int


class Clock(ABC):
    """
    The clock of a kernel.

    :ivar now_ns: a callable that returns the time in nanoseconds; monotonic.
    :ivar computed_ns: a callable that returns the CPU time of the kernel's thread.
    :ivar was_stopped: the process was stopped (SIGSTOP) and continued; the reader clears it.
    :ivar wake_ns: CPU time that it costs to set the timer and to be woken by it, measured by
        :meth:`attach`; 0 where that costs nothing.
    :ivar posix_timers: None, or the timers that the C core sets itself.
    :cvar has_signals: file descriptors interrupt running code.
    :cvar preemptive: the timer interrupts running code.
    """

    now_ns: Callable[[], int]
    computed_ns: Callable[[], int]
    was_stopped: bool = False
    wake_ns: int = 0
    posix_timers: PosixTimers | None = None
    has_signals: ClassVar[bool] = False
    preemptive: ClassVar[bool] = True

    @abstractmethod
    def attach(self, on_tick: Handler, on_interrupt: Handler, on_break: Handler) -> None:
        """
        Start to deliver timers and interrupts to these handlers.

        :param on_break: called when Ctrl-C is pressed, unless the program handles that itself.
        """

    @abstractmethod
    def detach(self) -> None:
        """Undo :meth:`attach`; may be called twice."""

    def wrap_handlers(self, run: Callable[..., None]) -> None:
        """
        Have a function call all other handlers of signals, until :meth:`detach`.

        :param run: called with the handler and its arguments; restores the recursion limit.
        """

    @abstractmethod
    def arm(self, deadline_ns: int) -> None:
        """
        Set the timer; this replaces the previous deadline.

        It repeats every ``REPEAT_NS`` until it is set again.
        """

    @abstractmethod
    def arm_spare(self, deadline_ns: int) -> None:
        """Set the spare timer in the same way."""

    @abstractmethod
    def swap(self) -> None:
        """Swap the roles of the two timers; neither stops."""

    @abstractmethod
    def mask_signals(self) -> None:
        """Mask the signals until :meth:`unmask_signals`: they stay pending, none is lost."""

    @abstractmethod
    def unmask_signals(self) -> None:
        """Unmask the signals."""

    @abstractmethod
    def wait_masked(self) -> bool:
        """
        Wait, with the signals masked, for the timer or an interrupt, and remove its signal.

        :return: True when something other than the timer may have ended the wait.
        """

    def wait(self, owner: HasPending) -> bool:
        """
        Mask the signals, :meth:`wait_masked` unless something is pending, and unmask them.

        :return: the result of :meth:`wait_masked`; False when something was pending.
        """
        self.mask_signals()
        came = not owner.pending and self.wait_masked()
        self.unmask_signals()
        return came

    def poll(self, until_ns: int) -> int:
        """
        Read the time while polling for a moment that is too near to wait for.

        Handlers of signals run between two calls, also if the caller is compiled code.

        :return: the time.
        """
        return self.now_ns()

    def raising(self, error: BaseException) -> Iterable[object]:
        """
        Prepare another interrupt for the moment at which the interrupted code continues.

        :param error: the exception that the handler raises in that code.
        :return: an iterable that sends the signal and raises the exception; empty when the timer
            is set already and the caller raises it.
        """
        self.arm(self.now_ns())
        return ()

    def waited_ns(self) -> int:
        """Return how long the thread has waited for a CPU, where the system provides that."""
        return 0

    def suspended_ns(self) -> int:
        """Return how long the machine has been suspended, which ``now_ns`` excludes."""
        return 0

    @abstractmethod
    def spend(self, duration_ns: int) -> None:
        """Simulate computing time; for tasks in a simulation or a test."""


def suspended_ns() -> int:
    """Return how long the machine has been suspended."""
    # CLOCK_BOOTTIME counts while the machine is suspended, see clock_gettime(2).
    return time.clock_gettime_ns(time.CLOCK_BOOTTIME) - time.monotonic_ns()


_MOVED: Final = {'MonotonicClock': 'monotonic_clock', 'VirtualClock': 'virtual_clock'}


def __getattr__(name: str) -> Any:
    """Provide moved names for one release."""
    if name not in _MOVED:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    warnings.warn(f'{name} has moved to rt_robot_os.kernel', DeprecationWarning, stacklevel=2)
    return getattr(import_module(f'rt_robot_os.kernel.{_MOVED[name]}'), name)
