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
A POSIX timer that sends a signal to one thread, and waiting for that signal.

``timer_create(CLOCK_MONOTONIC, SIGEV_THREAD_ID)`` (timer_create(2)): armed with an absolute time,
so that there is no drift, and directed to the thread that created it.
"""

from __future__ import annotations

from collections.abc import Iterable
import ctypes
import resource
import threading
from typing import Protocol

from rt_robot_os.base.compiled import NATIVE
from rt_robot_os.base.errors import StartError
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.linux import _libc
from rt_robot_os.linux.recursion import SEPARATE_LIMITS

# Before Python 3.12 a handler may find no stack left: the signal repeats at a shorter interval.
REPEAT_NS = 10 * NS_PER_MS if SEPARATE_LIMITS else NS_PER_MS


def make_timer(event: _libc.SigEvent, timer: ctypes.c_void_p) -> None:
    """
    Create a timer on CLOCK_MONOTONIC.

    :raises StartError: this user may not create more of them (RLIMIT_SIGPENDING).
    """
    try:
        _libc.timer_create(_libc.CLOCK_MONOTONIC, ctypes.byref(event), ctypes.byref(timer))
    except BlockingIOError as error:  # EAGAIN
        limit, _ = resource.getrlimit(resource.RLIMIT_SIGPENDING)
        raise StartError('Linux allows this user no further timer: pending signals are limited '
                         f'to {limit}; raise that: `ulimit -i 4096`, LimitSIGPENDING=4096 in a '
                         "unit of systemd, or '@realtime - sigpending 4096' in "
                         '/etc/security/limits.conf') from error


class SignalTimer:
    """
    An absolute timer on CLOCK_MONOTONIC that sends a signal to the creating thread.

    Until it is armed again it repeats the signal every ``REPEAT_NS``: the handler may have found
    no stack left in a task that recursed too deeply.

    :param signo: the signal to send; its handler must be installed before :meth:`arm`.
    :raises StartError: this user may not create more timers (RLIMIT_SIGPENDING).
    """

    def __init__(self, signo: int) -> None:
        event = _libc.SigEvent(signo=signo, notify=_libc.SIGEV_THREAD_ID,
                               thread_id=threading.get_native_id())
        self._timer = ctypes.c_void_p()
        make_timer(event, self._timer)
        self._spec_storage = (ctypes.c_int64 * 4)()
        self._spec = memoryview(self._spec_storage).cast('B').cast('q')
        self._spec[1] = REPEAT_NS
        self._arguments = (self._timer, ctypes.c_int(_libc.TIMER_ABSTIME),
                           ctypes.byref(self._spec_storage), None)
        self._alive = True
        if NATIVE is not None:
            self.arm = NATIVE.PosixTimer(  # type: ignore[method-assign]
                self._timer.value or 0, REPEAT_NS).arm

    def arm(self, deadline_ns: int) -> None:
        """
        Expire at the deadline, immediately if it has passed; safe in the real-time loop.

        :param deadline_ns: CLOCK_MONOTONIC, above zero; replaces the previous deadline.
        """
        spec = self._spec
        spec[2] = deadline_ns // NS_PER_S
        spec[3] = deadline_ns % NS_PER_S
        _libc.timer_settime(*self._arguments)

    @property
    def number(self) -> int:
        """Return its id for ``timer_settime``."""
        return self._timer.value or 0

    def disarm(self) -> None:
        """Remove the deadline."""
        spec = self._spec
        spec[2] = spec[3] = 0
        _libc.timer_settime(*self._arguments)

    def close(self) -> None:
        """Delete the timer; may be called twice."""
        if self._alive:
            self._alive = False
            _libc.timer_delete(self._timer)


class HasPending(Protocol):
    """The owner of a wait; ``pending`` means that there is work and it must not wait."""

    pending: bool


class SignalGate:
    """
    A set of signals that can be masked and awaited.

    :param signals: signal numbers from 1 to 64.
    """

    def __init__(self, signals: Iterable[int]) -> None:
        # sigset_t is 1024 bits; bit n-1 stands for signal n.
        self._set = (ctypes.c_uint64 * 16)()
        for signo in signals:
            self._set[0] |= 1 << (signo - 1)
        reference = ctypes.byref(self._set)
        self._mask_arguments = (ctypes.c_int(_libc.SIG_BLOCK), reference, None)
        self._unmask_arguments = (ctypes.c_int(_libc.SIG_UNBLOCK), reference, None)
        self._wait_arguments = (reference, None)
        if NATIVE is not None:
            gate = NATIVE.SignalGate(self._set[0])
            self.mask_signals = gate.mask_signals  # type: ignore[method-assign]
            self.unmask_signals = gate.unmask_signals  # type: ignore[method-assign]
            self.wait_masked = gate.wait_masked  # type: ignore[method-assign]
            self.wait = gate.wait  # type: ignore[method-assign]

    @property
    def mask(self) -> int:
        """Return the set: bit n-1 stands for signal n."""
        return int(self._set[0])

    def mask_signals(self) -> None:
        """Mask the signals: they stay pending; safe in the real-time loop."""
        _libc.pthread_sigmask(*self._mask_arguments)

    def unmask_signals(self) -> None:
        """Unmask the signals; safe in the real-time loop."""
        _libc.pthread_sigmask(*self._unmask_arguments)

    def wait_masked(self) -> int:
        """
        Sleep until one of the masked signals is pending, and remove it.

        :return: its number; -1 when a signal outside the set was handled instead.
        """
        result: int = _libc.sigwaitinfo(*self._wait_arguments)
        return result

    def wait(self, owner: HasPending) -> int:
        """
        Mask the signals, wait for one of them unless ``owner.pending``, and unmask them.

        :return: the result of :meth:`wait_masked`; 0 when something was pending.
        """
        self.mask_signals()
        # A signal before mask_signals() has set `pending`; a later one stays pending in Linux.
        signo = 0 if owner.pending else self.wait_masked()
        self.unmask_signals()
        return signo


class Sleeper:
    """Sleep by ``clock_nanosleep`` only: the minimum lateness of the machine, for benchmarks."""

    def __init__(self) -> None:
        self._storage = (ctypes.c_int64 * 2)()
        self._spec = memoryview(self._storage).cast('B').cast('q')
        self._arguments = (ctypes.c_int(_libc.CLOCK_MONOTONIC), ctypes.c_int(_libc.TIMER_ABSTIME),
                           ctypes.byref(self._storage), None)

    def sleep_until_ns(self, deadline_ns: int) -> None:
        """Sleep until the deadline on CLOCK_MONOTONIC."""
        self._spec[0] = deadline_ns // NS_PER_S
        self._spec[1] = deadline_ns % NS_PER_S
        _libc.clock_nanosleep(*self._arguments)
