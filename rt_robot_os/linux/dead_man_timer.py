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
A dead-man timer: it ends the process, whatever that is doing, unless it is restarted in time.

It consists of two POSIX timers (timer_create(2) with SIGEV_SIGNAL). The first sends SIGABRT, whose
default action ends the process even if a native call never returns to Python; with
:mod:`faulthandler` enabled it prints the traceback. The second sends SIGKILL a little later, for
code that blocks or handles SIGABRT.
"""

from __future__ import annotations

import ctypes
import signal

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.linux import _libc

KILL_AFTER_NS = NS_PER_S


class DeadManTimer:
    """
    A dead-man timer; inactive before the first :meth:`push`.

    :raises OSError: no timer is available (RLIMIT_SIGPENDING).
    """

    def __init__(self) -> None:
        self._timers: list[ctypes.c_void_p] = []
        self._spec_storage = (ctypes.c_int64 * 4)()
        self._spec = memoryview(self._spec_storage).cast('B').cast('q')
        try:
            for signo in (signal.SIGABRT, signal.SIGKILL):
                event = _libc.SigEvent(signo=signo, notify=_libc.SIGEV_SIGNAL)
                timer = ctypes.c_void_p()
                _libc.timer_create(_libc.CLOCK_MONOTONIC, ctypes.byref(event),
                                   ctypes.byref(timer))
                self._timers.append(timer)
        except OSError:
            self.close()
            raise

    def push(self, deadline_ns: int) -> None:
        """
        Move the deadline; about 3 us, safe in the real-time loop.

        :param deadline_ns: CLOCK_MONOTONIC, above zero; replaces the previous deadline.
        """
        for timer in self._timers:
            self._arm(timer, deadline_ns)
            deadline_ns += KILL_AFTER_NS

    def release(self) -> None:
        """Stop the timer; :meth:`push` starts it again."""
        for timer in self._timers:
            self._arm(timer, 0)

    def close(self) -> None:
        """Delete the timer; may be called twice."""
        while self._timers:
            _libc.timer_delete(self._timers.pop())

    def _arm(self, timer: ctypes.c_void_p, deadline_ns: int) -> None:
        self._spec[2] = deadline_ns // NS_PER_S
        self._spec[3] = deadline_ns % NS_PER_S
        _libc.timer_settime(timer, ctypes.c_int(_libc.TIMER_ABSTIME),
                            ctypes.byref(self._spec_storage), None)
