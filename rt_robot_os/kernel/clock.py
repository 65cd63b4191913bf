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
Time as the kernel sees it: now, two alarms, and waiting.

The kernel never asks which clock it has. Under :class:`MonotonicClock` the alarm is a signal that
interrupts the running Python code; under :class:`VirtualClock` time passes only where a task says
that it works (:meth:`Clock.spend`), and the alarm is a plain call. Both reach the same handler.
"""

from __future__ import annotations

from abc import ABC
from abc import abstractmethod
from collections.abc import Callable
from collections.abc import Iterable
from functools import partial
import signal
import threading
import time
from typing import Any
from typing import ClassVar
from typing import Final

from rt_robot_os.errors import TaskError
from rt_robot_os.linux.process import WaitingTime
from rt_robot_os.linux.raising import signal_and_raise
from rt_robot_os.linux.recursion import with_room
from rt_robot_os.linux.timer import AGAIN_NS
from rt_robot_os.linux.timer import Noting
from rt_robot_os.linux.timer import SignalGate
from rt_robot_os.linux.timer import SignalTimer
from rt_robot_os.units import NS_PER_MS
from rt_robot_os.units import NS_PER_US

# The largest power of two that compiled code need not keep in an object.
NEVER_NS: Final = 1 << 61

TICK_SIGNAL = signal.SIGRTMIN + 5
INTERRUPT_SIGNAL = signal.SIGRTMIN + 6
# What a clock without signals looks at this often while the kernel idles: file descriptors.
_LOOK_NS = NS_PER_MS

# Of a few wake-ups the cheapest counts: on a busy machine the others cost anything. What is dearer
# still is taken for this: nobody wants a CPU that is busy all the time.
WAKE_MOST_NS = 30 * NS_PER_US
_WAKE_LEAST_NS = 2 * NS_PER_US
_WAKE_TRIES = 5

Handler = Callable[..., None]


def signal_name(signo: int) -> str:
    """Name a signal; those of real time have numbers only."""
    try:
        return signal.Signals(signo).name
    except ValueError:
        return f'signal {signo}'


class Clock(ABC):
    """
    What a kernel needs of a clock.

    :ivar now_ns: a callable that gives the time in nanoseconds; never runs backwards.
    :ivar computed_ns: a callable that gives the computing time of the kernel's thread.
    :ivar was_stopped: the process was stopped (SIGSTOP) and went on; whoever looks clears it.
    :ivar wake_ns: computing time that it costs to set the alarm and to be woken by it, measured by
        :meth:`attach`; 0 where that costs nothing.
    :cvar has_signals: file descriptors interrupt what runs.
    :cvar preemptive: the alarm interrupts what runs.
    """

    now_ns: Callable[[], int]
    computed_ns: Callable[[], int]
    was_stopped: bool = False
    wake_ns: int = 0
    has_signals: ClassVar[bool] = False
    preemptive: ClassVar[bool] = True

    @abstractmethod
    def attach(self, on_tick: Handler, on_interrupt: Handler, on_break: Handler) -> None:
        """
        Start to deliver alarms and interrupts to these handlers.

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
        Set the alarm; the deadline set before is forgotten.

        It comes again every ``AGAIN_NS`` until it is set anew.
        """

    @abstractmethod
    def arm_spare(self, deadline_ns: int) -> None:
        """Set the other alarm, in the same way."""

    @abstractmethod
    def swap(self) -> None:
        """Let the two alarms change roles; neither stops."""

    @abstractmethod
    def hold(self) -> None:
        """Keep alarms and interrupts back until :meth:`admit`: none is lost meanwhile."""

    @abstractmethod
    def admit(self) -> None:
        """Let alarms and interrupts through."""

    @abstractmethod
    def wait(self) -> bool:
        """
        Wait, while they are held, for the alarm or an interrupt, and take it.

        :return: True when it may have been something else than the alarm.
        """

    def rest(self, owner: Noting) -> bool:
        """
        Hold alarms and interrupts back, :meth:`wait` unless something is pending, and admit them.

        :return: what :meth:`wait` gives; False when something was pending.
        """
        self.hold()
        came = not owner.pending and self.wait()
        self.admit()
        return came

    def look(self, until_ns: int) -> int:
        """
        Read the time once more, on the way to a moment that is too near to wait for.

        Between two calls handlers of signals run, also if the caller is compiled code.

        :return: the time.
        """
        return self.now_ns()

    def raising(self, error: BaseException) -> Iterable[object]:
        """
        Let the alarm come again as soon as what its handler interrupted goes on.

        :param error: what the handler raises in that.
        :return: what raises it, and sends the alarm, when it is iterated; empty when the alarm is
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


def _refuse(*_: object) -> Any:
    raise TaskError('the clock is not attached: a kernel does that when it runs')


def _nothing() -> None:
    """Do nothing, as long as the clock is not attached."""


def _suspended_ns() -> int:
    # CLOCK_BOOTTIME counts while the machine is suspended, see clock_gettime(2).
    return time.clock_gettime_ns(time.CLOCK_BOOTTIME) - time.monotonic_ns()


class MonotonicClock(Clock):
    """
    CLOCK_MONOTONIC with a POSIX timer signal as the alarm.

    :param wake_signals: signals that end a wait although they are none of the kernel's, such as
        SIGTERM; their own Python handlers are called.
    """

    has_signals = True

    def __init__(self, wake_signals: Iterable[int] = ()) -> None:
        self.now_ns = time.monotonic_ns
        self.computed_ns = time.thread_time_ns
        self._waiting = WaitingTime()
        self._arm: Callable[[int], None] = _refuse
        self._arm_spare: Callable[[int], None] = _refuse
        self._hold: Callable[[], None] = _nothing
        self._admit: Callable[[], None] = _nothing
        self._sigwait: Callable[[], int] = _refuse
        self._rest: Callable[[Noting], int] = _refuse
        self._wanted_wakes = tuple(int(s) for s in wake_signals)
        self._wakes: frozenset[int] = frozenset()
        self._timers: list[SignalTimer] = []
        # Its `pop` is the handler: in one of Python code, an alarm that came with the signal would
        # be served first, and know nothing of the stop.
        self._no_stop: dict[int, object] = {signal.SIGCONT: None}
        self._previous: dict[int, Any] = {}
        self._wrapped: dict[int, tuple[Any, Any]] = {}

    def attach(self, on_tick: Handler, on_interrupt: Handler, on_break: Handler) -> None:
        if threading.current_thread() is not threading.main_thread():
            raise TaskError(
                f'the kernel was started in thread {threading.current_thread().name!r}: '
                'Python runs signal handlers in the main thread only; start it there')
        on_tick, on_interrupt = with_room(on_tick), with_room(on_interrupt)
        handlers: dict[int, Handler] = {TICK_SIGNAL: on_tick, INTERRUPT_SIGNAL: on_interrupt}
        for signo in handlers:
            if signal.getsignal(signo) is not signal.SIG_DFL:
                raise TaskError(f'signal {signo} has a handler already: another kernel runs in '
                                'this process; run one after the other, or each in its own')
        # What the system sends when it has no room left for queueing INTERRUPT_SIGNAL (fcntl(2),
        # F_SETSIG); its default action ends the process.
        if signal.getsignal(signal.SIGIO) is signal.SIG_DFL:
            handlers[signal.SIGIO] = on_interrupt
        # KeyboardInterrupt, raised anywhere, would tear the kernel apart.
        wakes = [s for s in self._wanted_wakes if callable(signal.getsignal(s))]
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            handlers[signal.SIGINT] = on_break
            wakes.append(signal.SIGINT)
        self._wakes = frozenset(wakes)
        try:
            for signo, handler in handlers.items():
                self._previous[signo] = signal.signal(signo, handler)
            gate = SignalGate({*handlers, *wakes})
            self._timers.append(SignalTimer(TICK_SIGNAL))
            self._timers.append(SignalTimer(TICK_SIGNAL))
            # Not in the gate: it is noted at once, before an alarm that came meanwhile.
            if signal.getsignal(signal.SIGCONT) is signal.SIG_DFL:
                self._previous[signal.SIGCONT] = signal.signal(
                    signal.SIGCONT, self._no_stop.pop)
        except BaseException:
            self._close_timers()
            self._restore_handlers()
            raise
        self._arm, self._arm_spare = self._timers[0].arm, self._timers[1].arm
        self._hold, self._admit, self._sigwait = gate.hold, gate.admit, gate.wait
        self._rest = gate.rest
        self.wake_ns = self._measure_wake_ns()

    def _measure_wake_ns(self) -> int:
        """Set the alarm and wait for it, a few times; 0.3 ms."""
        timer, gate = self._timers[0], SignalGate((TICK_SIGNAL,))
        least_ns = WAKE_MOST_NS
        gate.hold()
        try:
            for _ in range(_WAKE_TRIES):
                begin_ns = self.computed_ns()
                timer.arm(self.now_ns() + WAKE_MOST_NS)
                while gate.wait() != TICK_SIGNAL:  # another one came first
                    pass
                least_ns = min(least_ns, self.computed_ns() - begin_ns)
        finally:
            timer.disarm()
            while signal.sigtimedwait((TICK_SIGNAL,), 0):  # nobody serves it yet
                pass
            gate.admit()
        return max(least_ns, _WAKE_LEAST_NS)

    @property
    def was_stopped(self) -> bool:
        return signal.SIGCONT not in self._no_stop

    @was_stopped.setter
    def was_stopped(self, stopped: bool) -> None:
        if stopped:
            self._no_stop.pop(signal.SIGCONT, None)
        else:
            self._no_stop[signal.SIGCONT] = None

    def wrap_handlers(self, run: Callable[..., None]) -> None:
        for signo in signal.valid_signals():
            handler = signal.getsignal(signo)
            if (callable(handler) and signo not in self._previous
                    and handler is not self._wrapped.get(signo, (None, None))[0]):
                wrapper = with_room(partial(run, handler))
                self._wrapped[signo] = (wrapper, handler)
                signal.signal(signo, wrapper)

    def detach(self) -> None:
        if not self._timers:
            return
        for timer in self._timers:
            timer.disarm()
        self._admit()
        self._arm = self._arm_spare = _refuse
        self._hold = self._admit = _nothing
        self._close_timers()
        # The default action of these signals ends the process, but none can come any more: the
        # timer is gone, and what was held has been let through to the old handler.
        self._restore_handlers()

    def _close_timers(self) -> None:
        while self._timers:
            self._timers.pop().close()

    def _restore_handlers(self) -> None:
        while self._wrapped:
            signo, (wrapper, handler) = self._wrapped.popitem()
            if signal.getsignal(signo) is wrapper:
                signal.signal(signo, handler)
        while self._previous:
            signo, handler = self._previous.popitem()
            signal.signal(signo, handler)

    def arm(self, deadline_ns: int) -> None:
        self._arm(deadline_ns)

    def arm_spare(self, deadline_ns: int) -> None:
        self._arm_spare(deadline_ns)

    def swap(self) -> None:
        self._arm, self._arm_spare = self._arm_spare, self._arm

    def hold(self) -> None:
        self._hold()

    def admit(self) -> None:
        self._admit()

    def raising(self, error: BaseException) -> Iterable[object]:
        return signal_and_raise(TICK_SIGNAL, error)

    def waited_ns(self) -> int:
        return self._waiting.read()

    def suspended_ns(self) -> int:
        return _suspended_ns()

    def rest(self, owner: Noting) -> bool:
        signo = self._rest(owner)
        return signo not in (0, TICK_SIGNAL) and self._take(signo)

    def wait(self) -> bool:
        signo = self._sigwait()
        return signo != TICK_SIGNAL and self._take(signo)

    def _take(self, signo: int) -> bool:
        """Do what another signal is for."""
        if signo in self._wakes:
            handler = signal.getsignal(signo)
            if callable(handler):
                handler(signo, None)
        return True

    def spend(self, duration_ns: int) -> None:
        now_ns = self.now_ns
        end_ns = now_ns() + duration_ns
        while now_ns() < end_ns:
            pass


class VirtualClock(Clock):
    """
    Time that passes only when a task spends it or when all are idle.

    The same tasks run in the same order each time, with no signal and as fast as possible.

    :param start_ns: the time at which it begins.
    """

    def __init__(self, start_ns: int = 0) -> None:
        self._now_ns = start_ns
        self._alarm_ns = NEVER_NS
        self._spare_ns = NEVER_NS
        self._on_tick: Handler | None = None
        self.now_ns = self.computed_ns = self._read

    def _read(self) -> int:
        return self._now_ns

    def attach(self, on_tick: Handler, on_interrupt: Handler, on_break: Handler) -> None:
        self._on_tick = on_tick

    def detach(self) -> None:
        self._on_tick = None
        self._alarm_ns = self._spare_ns = NEVER_NS

    def arm(self, deadline_ns: int) -> None:
        self._alarm_ns = deadline_ns

    def arm_spare(self, deadline_ns: int) -> None:
        self._spare_ns = deadline_ns

    def swap(self) -> None:
        self._alarm_ns, self._spare_ns = self._spare_ns, self._alarm_ns

    def hold(self) -> None:
        """Do nothing: nothing is asynchronous here."""

    def admit(self) -> None:
        """Do nothing: nothing is asynchronous here."""

    def wait(self) -> bool:
        first_ns = min(self._alarm_ns, self._spare_ns)
        if first_ns >= NEVER_NS:
            raise TaskError('the virtual clock has nothing to wait for: add a periodic task, or '
                            'give run() a duration')
        self._now_ns = max(self._now_ns, first_ns)
        self._take_alarms(NEVER_NS)
        return True

    def look(self, until_ns: int) -> int:
        first_ns = min(self._alarm_ns, self._spare_ns)
        self._now_ns = max(self._now_ns, min(until_ns, first_ns))
        if self._take_alarms(self._now_ns + AGAIN_NS) and self._on_tick is not None:
            self._on_tick()
        return self._now_ns

    def _take_alarms(self, again_ns: int) -> bool:
        """Take the alarms that are due; they come again at a time."""
        alarm, spare = self._alarm_ns <= self._now_ns, self._spare_ns <= self._now_ns
        if alarm:
            self._alarm_ns = again_ns
        if spare:
            self._spare_ns = again_ns
        return alarm or spare

    def spend(self, duration_ns: int) -> None:
        """Let time pass; what falls due preempts the caller and spends time of its own."""
        left_ns = duration_ns
        while left_ns > 0:
            first_ns = min(self._alarm_ns, self._spare_ns)
            step_ns = min(left_ns, max(0, first_ns - self._now_ns))
            self._now_ns += step_ns
            left_ns -= step_ns
            if self._take_alarms(self._now_ns + AGAIN_NS) and self._on_tick is not None:
                self._on_tick()


class CooperativeClock(Clock):
    """
    CLOCK_MONOTONIC, whose alarm interrupts nothing.

    A kernel on this clock looks at the time between two jobs, where a job calls
    ``kernel.settle()``, and where it publishes. Whatever a job does in between holds up all
    others, whatever their priorities: the longest job bounds every latency.
    """

    preemptive = False

    def __init__(self) -> None:
        self.now_ns = time.monotonic_ns
        self.computed_ns = time.thread_time_ns
        self._alarm_ns = NEVER_NS
        self._spare_ns = NEVER_NS

    def attach(self, on_tick: Handler, on_interrupt: Handler, on_break: Handler) -> None:
        """Do nothing: no handler will be called."""

    def detach(self) -> None:
        """Do nothing: nothing was attached."""

    def arm(self, deadline_ns: int) -> None:
        self._alarm_ns = deadline_ns

    def arm_spare(self, deadline_ns: int) -> None:
        self._spare_ns = deadline_ns

    def swap(self) -> None:
        self._alarm_ns, self._spare_ns = self._spare_ns, self._alarm_ns

    def hold(self) -> None:
        """Do nothing: nothing is asynchronous here."""

    def admit(self) -> None:
        """Do nothing: nothing is asynchronous here."""

    def suspended_ns(self) -> int:
        return _suspended_ns()

    def wait(self) -> bool:
        left_ns = min(self._alarm_ns - self.now_ns(), _LOOK_NS)
        if left_ns > 0:
            time.sleep(left_ns / 1e9)
        return True

    def spend(self, duration_ns: int) -> None:
        read_ns = self.now_ns
        end_ns = read_ns() + duration_ns
        while read_ns() < end_ns:
            pass
