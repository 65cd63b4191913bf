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

The kernel never asks which clock it has. Under :class:`~rt_robot_os.kernel.MonotonicClock` a timer
is a signal that interrupts the running Python code; under
:class:`~rt_robot_os.kernel.VirtualClock` time passes only where a task says that it works
(:meth:`Clock.spend`), and the interrupt is a plain call. Both reach the same handler.
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

from rt_robot_os.linux.timer import Noting

# Later than anything, and what is computed with it stays below 64 bits.
NEVER_NS: Final = 1 << 61

TICK_SIGNAL = signal.SIGRTMIN + 5
INTERRUPT_SIGNAL = signal.SIGRTMIN + 6

Handler = Callable[..., None]


def signal_name(signo: int) -> str:
    """Name a signal; those of real time have numbers only."""
    try:
        return signal.Signals(signo).name
    except ValueError:
        return f'signal {signo}'


class PosixTimers(NamedTuple):
    """
    The timers of a clock, and the signals that end its waits, as Linux calls them.

    :ivar first: what ``timer_settime`` calls the timer; ``second`` is the other one.
    :ivar again_ns: after how long they repeat.
    :ivar mask: the signals that end a wait: bit n-1 stands for signal n.
    :ivar tick_signal: that of the timers.
    """

    first: int
    second: int
    again_ns: int
    mask: int
    tick_signal: int


class Clock(ABC):
    """
    What a kernel needs of a clock.

    :ivar now_ns: a callable that gives the time in nanoseconds; never runs backwards.
    :ivar computed_ns: a callable that gives the computing time of the kernel's thread.
    :ivar was_stopped: the process was stopped (SIGSTOP) and went on; whoever looks clears it.
    :ivar wake_ns: computing time that it costs to set the timer and to be woken by it, measured by
        :meth:`attach`; 0 where that costs nothing.
    :ivar posix_timers: None, or what sets the timers and waits for them in C.
    :cvar has_signals: file descriptors interrupt what runs.
    :cvar preemptive: the timer interrupts what runs.
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
        Let other handlers of signals be called by a function, until :meth:`detach`.

        :param run: gets the handler and its arguments; sets the recursion limit at its end.
        """

    @abstractmethod
    def arm(self, deadline_ns: int) -> None:
        """
        Set the timer; the deadline set before is forgotten.

        It comes again every ``AGAIN_NS`` until it is set anew.
        """

    @abstractmethod
    def arm_spare(self, deadline_ns: int) -> None:
        """Set the other timer, in the same way."""

    @abstractmethod
    def swap(self) -> None:
        """Let the two timers change roles; neither stops."""

    @abstractmethod
    def mask_signals(self) -> None:
        """Let signals wait until :meth:`unmask_signals`: none is lost meanwhile."""

    @abstractmethod
    def unmask_signals(self) -> None:
        """Let signals through."""

    @abstractmethod
    def wait_masked(self) -> bool:
        """
        Wait, while they are masked, for the timer or an interrupt, and remove its signal.

        :return: True when it may have been something else than the timer.
        """

    def wait(self, owner: Noting) -> bool:
        """
        Mask the signals, :meth:`wait_masked` unless something is pending, and unmask them.

        :return: what :meth:`wait_masked` gives; False when something was pending.
        """
        self.mask_signals()
        came = not owner.pending and self.wait_masked()
        self.unmask_signals()
        return came

    def poll(self, until_ns: int) -> int:
        """
        Read the time once more, on the way to a moment that is too near to wait for.

        Between two calls handlers of signals run, also if the caller is compiled code.

        :return: the time.
        """
        return self.now_ns()

    def raising(self, error: BaseException) -> Iterable[object]:
        """
        Let the timer interrupt again as soon as what its handler interrupted goes on.

        :param error: what the handler raises in that.
        :return: what raises it, and sends the signal, when it is iterated; empty when the timer is
            set already, so that the caller raises it.
        """
        self.arm(self.now_ns())
        return ()

    def waited_ns(self) -> int:
        """Give the time that the thread waited for a CPU so far, if the system tells."""
        return 0

    def suspended_ns(self) -> int:
        """Give the time that the machine was suspended so far, which ``now_ns`` leaves out."""
        return 0

    @abstractmethod
    def spend(self, duration_ns: int) -> None:
        """Pretend to compute: what a task calls in a simulation or a test."""


def suspended_ns() -> int:
    """Give the time that the machine was suspended so far."""
    # CLOCK_BOOTTIME counts while the machine is suspended, see clock_gettime(2).
    return time.clock_gettime_ns(time.CLOCK_BOOTTIME) - time.monotonic_ns()


_MOVED: Final = {'MonotonicClock': 'monotonic_clock', 'VirtualClock': 'virtual_clock'}


def __getattr__(name: str) -> Any:
    """Find for one release what was here before."""
    if name not in _MOVED:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    warnings.warn(f'{name} has moved to rt_robot_os.kernel', DeprecationWarning, stacklevel=2)
    return getattr(import_module(f'rt_robot_os.kernel.{_MOVED[name]}'), name)
