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

"""The clock of a robot: CLOCK_MONOTONIC with the signals of POSIX timers."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterable
from functools import partial
import signal
import threading
import time
from typing import Any

from rt_robot_os.base.errors import TaskError
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_US
from rt_robot_os.kernel.clock import Clock
from rt_robot_os.kernel.clock import Handler
from rt_robot_os.kernel.clock import INTERRUPT_SIGNAL
from rt_robot_os.kernel.clock import PosixTimers
from rt_robot_os.kernel.clock import suspended_ns
from rt_robot_os.kernel.clock import TICK_SIGNAL
from rt_robot_os.linux.process import WaitingTime
from rt_robot_os.linux.raising import signal_and_raise
from rt_robot_os.linux.recursion import with_room
from rt_robot_os.linux.timer import HasPending
from rt_robot_os.linux.timer import SignalGate
from rt_robot_os.linux.timer import SignalTimer

# The cost of a wake-up is the least of a few measurements: load only adds to it. It is limited to
# this, as a higher value would make the kernel poll most of the time.
WAKE_MAXIMUM_NS = 30 * NS_PER_US
# Interval at which the timers of the C core repeat. If it were shorter than the time between jobs,
# Linux would reprogram the timer hardware at each repetition: 5 to 9 us.
_REPEAT_IN_C_NS = 10 * NS_PER_MS
_WAKE_MINIMUM_NS = 2 * NS_PER_US
_WAKE_TRIES = 5


def _refuse(*_: object) -> Any:
    raise TaskError('the clock is not attached: a kernel does that when it runs')


def _nothing() -> None:
    """Do nothing while the clock is not attached."""


class MonotonicClock(Clock):
    """
    CLOCK_MONOTONIC with the signals of POSIX timers.

    :param wake_signals: signals of others that end a wait as well, such as SIGTERM; their own
        Python handlers are called.
    """

    has_signals = True

    def __init__(self, wake_signals: Iterable[int] = ()) -> None:
        self.now_ns = time.monotonic_ns
        self.computed_ns = time.thread_time_ns
        self._waiting = WaitingTime()
        self._arm: Callable[[int], None] = _refuse
        self._arm_spare: Callable[[int], None] = _refuse
        self._mask: Callable[[], None] = _nothing
        self._unmask: Callable[[], None] = _nothing
        self._wait_masked: Callable[[], int] = _refuse
        self._wait: Callable[[HasPending], int] = _refuse
        self._wanted_wakes = tuple(int(s) for s in wake_signals)
        self._wakes: frozenset[int] = frozenset()
        self._timers: list[SignalTimer] = []
        # Its `pop` is the handler of SIGCONT. Before the first line of a Python handler, a timer
        # signal that arrived with SIGCONT would be served, without knowing of the stop.
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
        # Linux sends this when it cannot queue INTERRUPT_SIGNAL (fcntl(2), F_SETSIG); its default
        # action ends the process.
        if signal.getsignal(signal.SIGIO) is signal.SIG_DFL:
            handlers[signal.SIGIO] = on_interrupt
        # KeyboardInterrupt raised at an arbitrary point would leave the kernel inconsistent.
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
            # Not in the gate: its handler runs immediately, before that of a pending timer.
            if signal.getsignal(signal.SIGCONT) is signal.SIG_DFL:
                self._previous[signal.SIGCONT] = signal.signal(
                    signal.SIGCONT, self._no_stop.pop)
        except BaseException:
            self._close_timers()
            self._restore_handlers()
            raise
        self._arm, self._arm_spare = self._timers[0].arm, self._timers[1].arm
        self._mask, self._unmask = gate.mask_signals, gate.unmask_signals
        self._wait_masked, self._wait = gate.wait_masked, gate.wait
        self.posix_timers = PosixTimers(self._timers[0].number, self._timers[1].number,
                                        _REPEAT_IN_C_NS, gate.mask, TICK_SIGNAL)
        self.wake_ns = self._measure_wake_ns()

    def _measure_wake_ns(self) -> int:
        """Measure the cost of setting the timer and waiting for it; takes 0.3 ms."""
        timer, gate = self._timers[0], SignalGate((TICK_SIGNAL,))
        least_ns = WAKE_MAXIMUM_NS
        gate.mask_signals()
        try:
            for _ in range(_WAKE_TRIES):
                begin_ns = self.computed_ns()
                timer.arm(self.now_ns() + WAKE_MAXIMUM_NS)
                while gate.wait_masked() != TICK_SIGNAL:  # another signal came first
                    pass
                least_ns = min(least_ns, self.computed_ns() - begin_ns)
        finally:
            timer.disarm()
            while signal.sigtimedwait((TICK_SIGNAL,), 0):  # the kernel does not serve it yet
                pass
            gate.unmask_signals()
        return max(least_ns, _WAKE_MINIMUM_NS)

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
        self._unmask()
        self._arm = self._arm_spare = _refuse
        self._mask = self._unmask = _nothing
        self.posix_timers = None
        self._close_timers()
        # The default action of these signals ends the process, but none can come any more: the
        # timers are deleted, and pending signals were delivered to the old handlers.
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

    def mask_signals(self) -> None:
        self._mask()

    def unmask_signals(self) -> None:
        self._unmask()

    def raising(self, error: BaseException) -> Iterable[object]:
        return signal_and_raise(TICK_SIGNAL, error)

    def waited_ns(self) -> int:
        return self._waiting.read()

    def suspended_ns(self) -> int:
        return suspended_ns()

    def wait(self, owner: HasPending) -> bool:
        signo = self._wait(owner)
        return signo not in (0, TICK_SIGNAL) and self.serve_signal(signo)

    def wait_masked(self) -> bool:
        signo = self._wait_masked()
        return signo != TICK_SIGNAL and self.serve_signal(signo)

    def serve_signal(self, signo: int) -> bool:
        """Call the handler of a signal other than the timer's that ended a wait; return True."""
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
